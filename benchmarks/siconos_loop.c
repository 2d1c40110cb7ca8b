/* So many solves from nothing by a driver of Siconos, without Python between them. Drivers change their
   parameters, some the tolerance: these are put back, `parts` pieces of memory. */
#include <string.h>

typedef int (*Local)(void *problem, double *r, double *u, void *options);
typedef int (*Global)(void *problem, double *r, double *u, double *v, void *options);

int repeat(void *driver, void *problem, double *r, double *u, double *v, void *options, int rows,
           int velocities, void **parameters, void **kept, size_t *bytes, int parts, int times) {
    int info = 0;
    for (int i = 0; i < times; ++i) {
        for (int k = 0; k < parts; ++k) memcpy(parameters[k], kept[k], bytes[k]);
        memset(r, 0, rows * sizeof(double));
        memset(u, 0, rows * sizeof(double));
        memset(v, 0, velocities * sizeof(double));
        info = velocities ? ((Global)driver)(problem, r, u, v, options)
                          : ((Local)driver)(problem, r, u, options);
    }
    return info;
}
