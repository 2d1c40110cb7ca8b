"""Plan manipulation with contact models of every fidelity: one scene, six models, one equation.

import rungwise as rw
scene = rw.load("two_finger")
for model in rw.LADDER[1:]:
    run = rw.simulate(scene, model, parameters={"v2": 0.9})
    print(model.name, run.outcome, run.worst_residual)
"""

import lazy_loader

# A name is imported when it is first used: which names there are, and from where, stands in __init__.pyi.
_attribute, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    if name in __all__ or name.startswith("_"):
        return _attribute(name)
    from difflib import get_close_matches

    near = get_close_matches(name, __all__, 1)
    meant = f"; did you mean {near[0]}?" if near else ""
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}{meant}", name=name)


__version__ = "0.2.0"
