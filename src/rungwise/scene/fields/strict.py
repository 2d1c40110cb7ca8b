"""The base of all parts of a scene."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator
from pydantic_core import PydanticCustomError

from rungwise.scene.fields.values import shown
from rungwise.wording import choices


class Strict(BaseModel):
    """Base of all parts of a scene: immutable, and an unknown field is an error that lists the valid ones."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    @model_validator(mode="before")
    @classmethod
    def _known_fields(cls, data: Any) -> Any:
        if isinstance(data, cls):
            return data
        valid = ", ".join(cls.model_fields)
        if not isinstance(data, dict):
            raise PydanticCustomError(
                "mapping", "must be a mapping of fields, not {given}; valid: {valid}",
                {"given": shown(data), "valid": valid},
            )  # fmt: skip
        for key in data:
            if key not in cls.model_fields:
                raise PydanticCustomError(
                    "unknown_field",
                    "unknown field {key}{choices}",
                    {"key": shown(key), "choices": choices(key, cls.model_fields)},
                )
        return data
