"""The fields of a scene file, as pydantic models."""
