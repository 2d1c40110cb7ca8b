"""What all parts of a scene file have in common: unknown fields and kinds are errors that list the valid
ones."""

from __future__ import annotations

from typing import Any, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, model_validator
from pydantic_core import PydanticCustomError

from rungwise.scene.values import shown


def kinds(*models: type[BaseModel]) -> BeforeValidator:
    """Require a mapping whose field `kind` is the kind of one of `models`."""
    kinds = [get_args(model.model_fields["kind"].annotation)[0] for model in models]
    valid = ", ".join(kinds)

    def known(value: object) -> object:
        if isinstance(value, models):
            return value
        if not isinstance(value, dict):
            raise PydanticCustomError(
                "mapping", "must be a mapping with a kind, not {given}; valid: {valid}",
                {"given": shown(value), "valid": valid},
            )  # fmt: skip
        if "kind" not in value:
            raise PydanticCustomError("kind", "is required; valid: {valid}", {"valid": valid})
        if value["kind"] not in kinds:
            raise PydanticCustomError(
                "kind",
                "unknown kind {given}; valid: {valid}",
                {"given": shown(value["kind"]), "valid": valid},
            )
        return value

    return BeforeValidator(known)


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
                    "unknown field {key}; valid: {valid}",
                    {"key": shown(key), "valid": valid},
                )
        return data
