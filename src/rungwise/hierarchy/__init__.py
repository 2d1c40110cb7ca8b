"""The hierarchy between the models, measured on a scene: the paper's Definitions 1 and 2, and its Table 1."""
