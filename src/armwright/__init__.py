"""Which arm should I build for this task?

import armwright as aw

problem = aw.Problem(task=aw.load_task("target-1"), space=aw.paper_space(joints=4))
run = aw.optimize(problem, proposer="rules", n_total=200, seed=0, out="runs/mine")
print(run.hypervolume[-1], aw.to_urdf(run.front[0].arm))
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)  # pyright: ignore[reportUnknownVariableType]
