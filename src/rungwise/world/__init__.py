"""The contract of a world, and what is asked of worlds: runs, rollouts, batches, conditions at states.

Scenes in the plane and in space implement the contract, each in one folder; rooms above know nothing else.
"""
