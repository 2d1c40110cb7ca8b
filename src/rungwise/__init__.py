"""Plan manipulation with contact models of every fidelity: one scene, six models, one equation.

import rungwise as rw
scene = rw.load("two_finger")
for model in rw.LADDER[1:]:
    run = rw.simulate(scene, model, parameters={"v2": 0.9})
    print(model.name, run.outcome, run.worst_residual)
"""

import lazy_loader

# A name is imported when it is first used: which names there are, and from where, stands in __init__.pyi.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = "0.1.0"
