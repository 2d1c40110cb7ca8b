/* So many solves from nothing by a driver of Siconos, without Python between them. Drivers change their
   parameters, some the tolerance: these are put back, `parts` pieces of memory. Where there is set-up that
   keeps what the solver learns, it is done anew for each solve; without a driver it is done alone. */
#include <string.h>

typedef int (*Local)(void *problem, double *r, double *u, void *options);
typedef int (*Global)(void *problem, double *r, double *u, double *v, void *options);
typedef void (*SetUp)(void *problem, void *options);

int repeat(void *driver, void *begin, void *end, void *problem, double *r, double *u, double *v,
           void *options, int rows, int velocities, void **parameters, void **kept, size_t *bytes,
           int parts, int times) {
    int info = 0;
    for (int i = 0; i < times; ++i) {
        for (int k = 0; k < parts; ++k) memcpy(parameters[k], kept[k], bytes[k]);
        memset(r, 0, rows * sizeof(double));
        memset(u, 0, rows * sizeof(double));
        memset(v, 0, velocities * sizeof(double));
        if (begin) ((SetUp)begin)(problem, options);
        if (driver)
            info = velocities ? ((Global)driver)(problem, r, u, v, options)
                              : ((Local)driver)(problem, r, u, options);
        if (end) ((SetUp)end)(problem, options);
    }
    return info;
}
