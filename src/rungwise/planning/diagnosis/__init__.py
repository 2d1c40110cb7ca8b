"""Why a plan that holds on one model fails, or drifts, on another."""
