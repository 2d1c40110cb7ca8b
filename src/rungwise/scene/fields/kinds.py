"""Fields of several kinds, told apart by `kind`."""

from __future__ import annotations

from typing import get_args

from pydantic import BaseModel, BeforeValidator
from pydantic_core import PydanticCustomError

from rungwise.scene.fields.values import shown
from rungwise.wording import choices


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
                "unknown kind {given}{choices}",
                {"given": shown(value["kind"]), "choices": choices(value["kind"], kinds)},
            )
        return value

    return BeforeValidator(known)
