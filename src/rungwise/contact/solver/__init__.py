"""The contact solver: groups of rows, each of one kind, one method, one residual."""
