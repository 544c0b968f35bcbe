"""The part of pybullet that engines/bullet calls."""

from collections.abc import Sequence

ACTIVATION_STATE_DISABLE_SLEEPING: int
DIRECT: int
GEOM_BOX: int
GEOM_SPHERE: int
MESH_DATA_SIMULATION_MESH: int
RESET_USE_DEFORMABLE_WORLD: int
WORLD_FRAME: int

class error(Exception): ...  # noqa: N801, N818

Triple = tuple[float, float, float]

def applyExternalForce(
    objectUniqueId: int,
    linkIndex: int,
    forceObj: Sequence[float],
    posObj: Sequence[float],
    flags: int,
    physicsClientId: int = ...,
) -> None: ...
def changeDynamics(
    bodyUniqueId: int,
    linkIndex: int,
    lateralFriction: float = ...,
    linearDamping: float = ...,
    angularDamping: float = ...,
    localInertiaDiagonal: Sequence[float] = ...,
    activationState: int = ...,
    physicsClientId: int = ...,
) -> None: ...
def connect(method: int) -> int: ...
def createCollisionShape(
    shapeType: int, radius: float = ..., halfExtents: Sequence[float] = ..., physicsClientId: int = ...
) -> int: ...
def createMultiBody(
    baseMass: float = ...,
    baseCollisionShapeIndex: int = ...,
    basePosition: Sequence[float] = ...,
    baseOrientation: Sequence[float] = ...,
    useMaximalCoordinates: bool = ...,
    physicsClientId: int = ...,
) -> int: ...
def createSoftBodyAnchor(
    softBodyBodyUniqueId: int, nodeIndex: int, bodyUniqueId: int, linkIndex: int, physicsClientId: int = ...
) -> int: ...
def disconnect(physicsClientId: int = ...) -> None: ...
def getBasePositionAndOrientation(
    bodyUniqueId: int, physicsClientId: int = ...
) -> tuple[Triple, tuple[float, float, float, float]]: ...
def getBaseVelocity(bodyUniqueId: int, physicsClientId: int = ...) -> tuple[Triple, Triple]: ...
def getMeshData(
    bodyUniqueId: int, linkIndex: int = ..., flags: int = ..., physicsClientId: int = ...
) -> tuple[int, tuple[Triple, ...]]: ...
def loadSoftBody(
    fileName: str,
    basePosition: Sequence[float] = ...,
    mass: float = ...,
    collisionMargin: float = ...,
    useNeoHookean: bool = ...,
    NeoHookeanMu: float = ...,
    NeoHookeanLambda: float = ...,
    NeoHookeanDamping: float = ...,
    useSelfCollision: bool = ...,
    useFaceContact: bool = ...,
    frictionCoeff: float = ...,
    physicsClientId: int = ...,
) -> int: ...
def removeBody(bodyUniqueId: int, physicsClientId: int = ...) -> None: ...
def removeConstraint(userConstraintUniqueId: int, physicsClientId: int = ...) -> None: ...
def resetBasePositionAndOrientation(
    bodyUniqueId: int, posObj: Sequence[float], ornObj: Sequence[float], physicsClientId: int = ...
) -> None: ...
def resetBaseVelocity(
    objectUniqueId: int,
    linearVelocity: Sequence[float],
    angularVelocity: Sequence[float],
    physicsClientId: int = ...,
) -> None: ...
def resetMeshData(
    bodyUniqueId: int, vertices: Sequence[Sequence[float]], physicsClientId: int = ...
) -> None: ...
def resetSimulation(flags: int = ..., physicsClientId: int = ...) -> None: ...
def setCollisionFilterPair(
    bodyUniqueIdA: int,
    bodyUniqueIdB: int,
    linkIndexA: int,
    linkIndexB: int,
    enableCollision: int,
    physicsClientId: int = ...,
) -> None: ...
def setCollisionFilterGroupMask(
    bodyUniqueId: int,
    linkIndexA: int,
    collisionFilterGroup: int,
    collisionFilterMask: int,
    physicsClientId: int = ...,
) -> None: ...
def setGravity(gravX: float, gravY: float, gravZ: float, physicsClientId: int = ...) -> None: ...
def setPhysicsEngineParameter(useSplitImpulse: int = ..., physicsClientId: int = ...) -> None: ...
def setTimeStep(timeStep: float, physicsClientId: int = ...) -> None: ...
def stepSimulation(physicsClientId: int = ...) -> None: ...
