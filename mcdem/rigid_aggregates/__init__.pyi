from .passage import approach as approach
from .passage import pass_by as pass_by
from .statics import RigidBody as RigidBody
from .statics import analyse as analyse
from .statics import turn_rigidly as turn_rigidly
from .statics import worst_load as worst_load
from .statics_with_torques import analyse_with_torques as analyse_with_torques
