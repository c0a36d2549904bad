"""MuJoCo's own functions, for compiled code to call by name; addresses of mjModel and mjData go in."""

from numba import types

fwd_actuation = types.ExternalFunction("mj_fwdActuation", types.void(types.intp, types.intp))
rne = types.ExternalFunction("mj_rne", types.void(types.intp, types.intp, types.intc, types.intp))
reference_constraint = types.ExternalFunction("mj_referenceConstraint", types.void(types.intp, types.intp))
is_sparse = types.ExternalFunction("mj_isSparse", types.intc(types.intp))
smooth_vel = types.ExternalFunction("mjd_smooth_vel", types.void(types.intp, types.intp, types.intc))
ray_geom = types.ExternalFunction(
    "mju_rayGeom",
    types.float64(types.intp, types.intp, types.intp, types.intp, types.intp, types.intc, types.intp),
)
"""From place, orientation and size of a geom, a point, a direction, and the geom's type; then where its normal goes."""
