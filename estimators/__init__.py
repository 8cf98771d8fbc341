"""Estimators and consensus laws: pure functions and small state machines over numpy.

`plane` holds the linear map and the exact inverse of the flying array's kinematics, `least_squares` the centralised and
the neighbourhood estimate, `information` information pairs, `consensus` their Metropolis round, `averaging`,
`running_sum`, `flow_updating` and `push_sum` the laws of average consensus that `laws` puts behind one interface, and
`metrics` what is measured of a run, as `metrics.error` and so on. `attitude` is about directions seen from a body,
`dynamic_consensus` about averages of attitudes that follow what agents estimate, `trust` about sensors whose readings
stop being near what is predicted of them.

The formation of MAVs is imported by module, as it needs more of scipy than other agents want in memory:
`formation_model` the dynamics, `formation_filter` the Kalman filter over `formation_joseph` or
`formation_square_root`, `formation_consensus` the distributed one with `formation_messages` and
`formation_intersection`, `formation_control` the regulator, and `formation_assignment` who tracks whom. So are their
frames: `inertial_frame` filters the attitude of one vehicle, `so3_consensus` is the law by which several agree on one
frame, and `frame_consensus` both as one agent needs them. So is the altitude filter: `modular_filter` puts
`altitude_components` together, and `replay` takes what they measure in any order. So is moving horizon estimation:
`error_state` says what a model with an error state is, `quadrotor_model` and `attitude_model` are such models,
`moving_horizon` smooths `windows` of one with bounds by `quadratic_programs`, and `error_state_kalman` is the filter
beside it. So are distributed Kalman filters: `filters` has them by name, `filtering` says what one is, `gaussian` has
beliefs about a state that moves, and `average_consensus` the ways to average beneath them, `chebyshev` and `gossip`
among these. The filters are in `kalman_consensus`, `diffusion`, `consensus_filters`, `covariance_intersection` and
`event_triggered`.
"""

from . import metrics
from .attitude import learned_quaternion, least_squares_attitude, observation_matrix
from .averaging import (
    Averaging,
    averaging_message,
    averaging_receive,
    averaging_round,
    averaging_start,
    averaging_update,
    averaging_value,
    weighted_average,
)
from .consensus import (
    PACKED_SIZE,
    estimate,
    initial_pair,
    metropolis_round,
)
from .dynamic_consensus import ToldAttitude, collective_matrices, consensus_rate, consensus_step, largest_step
from .flow_updating import (
    FlowUpdating,
    flow_updating_message,
    flow_updating_receive,
    flow_updating_round,
    flow_updating_start,
    flow_updating_update,
    flow_updating_value,
)
from .information import InformationPair, pack_pair, unpack_pair
from .laws import LAWS, ConsensusLaw
from .least_squares import (
    WELL_CONDITIONED,
    HandedEstimate,
    centralised_estimate,
    covariance,
    hand_on,
    neighbourhood_estimate,
    noncollinear,
    well_conditioned,
)
from .plane import design_matrix, design_row, exact_state
from .running_sum import (
    RunningSum,
    running_sum_message,
    running_sum_receive,
    running_sum_round,
    running_sum_start,
    running_sum_update,
    running_sum_value,
)
from .trust import RETURN, Trust, judged

__all__ = [
    "LAWS",
    "PACKED_SIZE",
    "RETURN",
    "WELL_CONDITIONED",
    "Averaging",
    "ConsensusLaw",
    "FlowUpdating",
    "HandedEstimate",
    "InformationPair",
    "RunningSum",
    "ToldAttitude",
    "Trust",
    "averaging_message",
    "averaging_receive",
    "averaging_round",
    "averaging_start",
    "averaging_update",
    "averaging_value",
    "centralised_estimate",
    "collective_matrices",
    "consensus_rate",
    "consensus_step",
    "covariance",
    "design_matrix",
    "design_row",
    "estimate",
    "exact_state",
    "flow_updating_message",
    "flow_updating_receive",
    "flow_updating_round",
    "flow_updating_start",
    "flow_updating_update",
    "flow_updating_value",
    "hand_on",
    "initial_pair",
    "judged",
    "largest_step",
    "learned_quaternion",
    "least_squares_attitude",
    "metrics",
    "metropolis_round",
    "neighbourhood_estimate",
    "noncollinear",
    "observation_matrix",
    "pack_pair",
    "running_sum_message",
    "running_sum_receive",
    "running_sum_round",
    "running_sum_start",
    "running_sum_update",
    "running_sum_value",
    "unpack_pair",
    "weighted_average",
    "well_conditioned",
]
