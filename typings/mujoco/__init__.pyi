"""The part of MuJoCo's bindings that Trocar uses, typed; the wheel brings no annotations."""

from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
_Numbers = Sequence[float] | _Array

class mjtState(IntEnum):
    mjSTATE_QFRC_APPLIED = ...
    mjSTATE_XFRC_APPLIED = ...
    mjSTATE_INTEGRATION = ...

class mjtWarning(IntEnum):
    mjWARN_BADQPOS = ...
    mjWARN_BADQVEL = ...
    mjWARN_BADQACC = ...
    mjWARN_BADCTRL = ...

class mjtJoint(IntEnum):
    mjJNT_FREE = ...
    mjJNT_HINGE = ...
    mjJNT_SLIDE = ...

class mjtTrn(IntEnum):
    mjTRN_JOINT = ...
    mjTRN_TENDON = ...
    mjTRN_SITE = ...

class mjtLightType(IntEnum):
    mjLIGHT_DIRECTIONAL = ...

class mjtGeom(IntEnum):
    mjGEOM_ARROW = ...
    mjGEOM_CYLINDER = ...
    mjGEOM_ELLIPSOID = ...
    mjGEOM_TRIANGLE = ...
    mjGEOM_MESH = ...
    mjGEOM_BOX = ...
    mjGEOM_CAPSULE = ...
    mjGEOM_SPHERE = ...
    mjGEOM_PLANE = ...
    mjGEOM_ELLIPSOID = ...

class mjtCtrlInput(IntEnum):
    mjINPUT_POS = ...
    mjINPUT_VEL = ...
    mjINPUT_FF = ...

class mjtEq(IntEnum):
    mjEQ_WELD = ...
    mjEQ_JOINT = ...
    mjEQ_FLEX = ...

class mjtFlexSection(IntEnum):
    mjFLEXSECTION_CIRCLE = ...

class mjtDisableBit(IntEnum):
    mjDSBL_ISLAND = ...
    mjDSBL_MIDPHASE = ...
    mjDSBL_SENSOR = ...

class mjtCone(IntEnum):
    mjCONE_ELLIPTIC = ...

class mjtIntegrator(IntEnum):
    mjINT_DISCRETE = ...
    mjINT_IMPLICITFAST = ...

class mjtObj(IntEnum):
    mjOBJ_FLEX = ...
    mjOBJ_BODY = ...
    mjOBJ_XBODY = ...
    mjOBJ_JOINT = ...
    mjOBJ_SITE = ...
    mjOBJ_GEOM = ...
    mjOBJ_MESH = ...
    mjOBJ_ACTUATOR = ...

class mjtSensor(IntEnum):
    mjSENS_JOINTPOS = ...
    mjSENS_JOINTVEL = ...
    mjSENS_JOINTACTFRC = ...
    mjSENS_ACTUATORPOS = ...
    mjSENS_ACTUATORVEL = ...
    mjSENS_ACTUATORFRC = ...
    mjSENS_FRAMEPOS = ...
    mjSENS_FRAMEQUAT = ...
    mjSENS_FRAMELINVEL = ...
    mjSENS_FRAMEANGVEL = ...

class MjsCompiler:
    degree: bool
    boundinertia: float
    boundmass: float

class MjOption:
    timestep: float
    integrator: mjtIntegrator
    cone: mjtCone
    impratio: float
    disableflags: int
    gravity: _Array

class MjsElement:
    name: str

class MjsJoint(MjsElement):
    limited: int
    armature: float
    axis: _Array
    damping: _Numbers
    frictionloss: float
    range: _Array
    solimp_limit: _Numbers
    solref_limit: _Numbers
    springref: float
    stiffness: _Numbers
    type: mjtJoint

class MjsActuator(MjsElement):
    gear: _Array
    ctrlrange: _Array
    forcerange: _Array
    velrange: _Array
    def set_to_pid(self, kp: float, kv: float = ..., ctrlspec: int = ...) -> None: ...

class MjsEquality(MjsElement):
    name1: str
    name2: str
    data: _Array

class MjsSensor(MjsElement):
    objtype: mjtObj
    objname: str
    reftype: mjtObj
    refname: str
    intprm: NDArray[np.int32]

class MjsSite(MjsElement): ...

class MjsTendon(MjsElement):
    def wrap_joint(self, name: str, coef: float) -> None: ...

class MjsMaterial(MjsElement):
    rgba: _Array
    textures: list[str]
    metallic: float
    roughness: float

class MjsMesh(MjsElement):
    file: str
    uservert: _Numbers
    userface: Sequence[int] | NDArray[np.int32]

class MjsGeom(MjsElement):
    parent: MjsBody
    type: mjtGeom
    size: _Array
    pos: _Array
    quat: _Array
    fromto: _Array
    rgba: _Array
    meshname: str
    material: str
    contype: int
    conaffinity: int
    mass: float

class MjsBody(MjsElement):
    pos: _Array
    gravcomp: float
    parent: MjsBody
    bodies: list[MjsBody]
    joints: list[MjsJoint]
    geoms: list[MjsGeom]
    sites: list[MjsSite]
    mass: float
    ipos: _Numbers
    inertia: _Numbers
    fullinertia: _Numbers
    explicitinertial: bool
    def add_body(self, **fields: Any) -> MjsBody: ...
    def add_freejoint(self, **fields: Any) -> MjsJoint: ...
    def add_joint(self, **fields: Any) -> MjsJoint: ...
    def add_geom(self, **fields: Any) -> None: ...
    def add_light(self, **fields: Any) -> None: ...
    def add_site(self, **fields: Any) -> None: ...

class MjsKey:
    name: str
    qpos: _Array
    qvel: _Array
    ctrl: _Array

class MjSpec:
    @staticmethod
    def from_file(filename: str) -> MjSpec: ...
    @staticmethod
    def from_string(xml: str) -> MjSpec: ...
    compiler: MjsCompiler
    option: MjOption
    worldbody: MjsBody
    meshdir: str
    modelname: str
    bodies: list[MjsBody]
    geoms: list[MjsGeom]
    meshes: list[MjsMesh]
    materials: list[MjsMaterial]
    def actuator(self, name: str) -> MjsActuator: ...
    def add_actuator(self, **fields: Any) -> MjsActuator: ...
    def add_equality(self, **fields: Any) -> MjsEquality: ...
    def add_key(self, **fields: Any) -> MjsKey: ...
    def add_material(self, **fields: Any) -> MjsMaterial: ...
    def add_mesh(self, **fields: Any) -> MjsMesh: ...
    def add_flex(self, **fields: Any) -> MjsElement: ...
    def add_skin(self, **fields: Any) -> MjsElement: ...
    def add_sensor(self, **fields: Any) -> MjsSensor: ...
    def add_pair(self, **fields: Any) -> None: ...
    def add_numeric(self, **fields: Any) -> MjsElement: ...
    def add_text(self, **fields: Any) -> MjsElement: ...
    def add_tendon(self, **fields: Any) -> MjsTendon: ...
    def add_texture(self, **fields: Any) -> None: ...
    def body(self, name: str) -> MjsBody: ...
    def compile(self) -> MjModel: ...
    def delete(self, element: MjsElement) -> None: ...
    def equality(self, name: str) -> MjsEquality | None: ...
    def geom(self, name: str) -> MjsGeom: ...
    def joint(self, name: str) -> MjsJoint: ...
    def key(self, name: str) -> MjsKey: ...
    def material(self, name: str) -> MjsMaterial | None: ...
    def mesh(self, name: str) -> MjsMesh | None: ...
    def site(self, name: str) -> MjsSite: ...
    def to_xml(self) -> str: ...

class _Element:
    id: int
    name: str
    mass: _Array
    inertia: _Array
    ipos: _Array
    iquat: _Array
    pos: _Array
    quat: _Array
    adr: NDArray[np.int32]
    objid: NDArray[np.int32]
    dofadr: NDArray[np.int32]
    qpos0: _Array
    qposadr: NDArray[np.int32]
    geomadr: NDArray[np.int32]
    geomnum: NDArray[np.int32]
    mocapid: NDArray[np.int32]

class _Skin:
    id: int
    vertadr: NDArray[np.int32]
    vertnum: NDArray[np.int32]

class MjModel:
    @staticmethod
    def from_xml_string(xml: str) -> MjModel: ...
    opt: MjOption
    nq: int
    nmat: int
    ngeom: int
    nskin: int
    nflex: int
    stat: MjStatistic
    vis: MjVisual
    nv: int
    nu: int
    neq: int
    nbody: int
    nsensor: int
    nsensordata: int
    site_bodyid: NDArray[np.int32]
    actuator_biasprm: _Array
    actuator_ctrladr: NDArray[np.int32]
    actuator_gainprm: _Array
    actuator_trnid: NDArray[np.int32]
    actuator_trntype: NDArray[np.int32]
    njnt: int
    ntendon: int
    tendon_adr: NDArray[np.int32]
    tendon_num: NDArray[np.int32]
    tendon_solimp_fri: _Array
    tendon_solref_fri: _Array
    wrap_objid: NDArray[np.int32]
    wrap_prm: _Array
    body_gravcomp: _Array
    body_mass: _Array
    body_dofadr: NDArray[np.int32]
    body_parentid: NDArray[np.int32]
    nsite: int
    geom_aabb: _Array
    geom_bodyid: NDArray[np.int32]
    sensor_objtype: NDArray[np.int32]
    sensor_objid: NDArray[np.int32]
    tendon_frictionloss: _Array
    geom_conaffinity: NDArray[np.int32]
    geom_contype: NDArray[np.int32]
    body_inertia: _Array
    geom_dataid: NDArray[np.int32]
    geom_group: NDArray[np.int32]
    geom_matid: NDArray[np.int32]
    geom_margin: _Array
    geom_pos: _Array
    geom_quat: _Array
    geom_rgba: NDArray[np.float32]
    geom_rbound: _Array
    geom_size: _Array
    mat_rgba: NDArray[np.float32]
    mesh_face: NDArray[np.int32]
    mesh_faceadr: NDArray[np.int32]
    mesh_facenum: NDArray[np.int32]
    mesh_vert: NDArray[np.float32]
    mesh_vertadr: NDArray[np.int32]
    mesh_vertnum: NDArray[np.int32]
    geom_type: NDArray[np.int32]
    eq_active0: NDArray[np.uint8]
    eq_data: _Array
    eq_obj1id: NDArray[np.int32]
    eq_obj2id: NDArray[np.int32]
    eq_type: NDArray[np.int32]
    jnt_bodyid: NDArray[np.int32]
    jnt_dofadr: NDArray[np.int32]
    jnt_limited: NDArray[np.uint8]
    jnt_qposadr: NDArray[np.int32]
    jnt_range: _Array
    body_jntadr: NDArray[np.int32]
    dof_M0: _Array
    dof_armature: _Array
    dof_bodyid: NDArray[np.int32]
    dof_damping: _Array
    dof_frictionloss: _Array
    dof_solimp: _Array
    dof_solref: _Array
    jnt_stiffness: _Array
    qpos_spring: _Array
    skin_vert: NDArray[np.float32]
    skin_group: NDArray[np.int32]
    flex_elem: NDArray[np.int32]
    flex_elemadr: NDArray[np.int32]
    flex_elemdataadr: NDArray[np.int32]
    flex_edgenum: NDArray[np.int32]
    flex_elemnum: NDArray[np.int32]
    flex_elemtexcoord: NDArray[np.int32]
    flex_group: NDArray[np.int32]
    flex_matid: NDArray[np.int32]
    flex_shellnum: NDArray[np.int32]
    flex_texcoord: NDArray[np.float32]
    flex_texcoordadr: NDArray[np.int32]
    flex_vertadr: NDArray[np.int32]
    flex_vertnum: NDArray[np.int32]
    def actuator(self, name: str) -> _Element: ...
    def body(self, name: str | int) -> _Element: ...
    def equality(self, name: str | int) -> _Element: ...
    def skin(self, name: str) -> _Skin: ...
    def material(self, name: str | int) -> _Element: ...
    def joint(self, name: str | int) -> _Element: ...
    def tendon(self, name: str | int) -> _Element: ...
    def sensor(self, name: str | int) -> _Element: ...
    def site(self, name: str | int) -> _Element: ...

class _Warnings:
    number: NDArray[np.int32]

class _Contacts:
    geom: NDArray[np.int32]
    pos: _Array
    frame: _Array

class MjData:
    actuator_force: _Array
    mocap_pos: _Array
    mocap_quat: _Array
    flexvert_xpos: _Array
    contact: _Contacts
    efc_force: _Array
    efc_id: NDArray[np.int32]
    efc_type: NDArray[np.int32]
    eq_active: NDArray[np.uint8]
    ncon: int
    qacc: _Array
    qfrc_bias: _Array
    qfrc_gravcomp: _Array
    xanchor: _Array
    xaxis: _Array
    xpos: _Array
    xquat: _Array
    xmat: _Array
    ctrl: _Array
    qpos: _Array
    qvel: _Array
    sensordata: _Array
    site_xmat: _Array
    site_xpos: _Array
    geom_xmat: _Array
    geom_xpos: _Array
    xipos: _Array
    warning: _Warnings
    qfrc_applied: _Array
    xfrc_applied: _Array
    def __init__(self, model: MjModel) -> None: ...

def mj_camlight(m: MjModel, d: MjData) -> None: ...
def mj_comPos(m: MjModel, d: MjData) -> None: ...
def mj_collision(m: MjModel, d: MjData) -> None: ...
def mj_kinematics(m: MjModel, d: MjData) -> None: ...
def mj_contactForce(m: MjModel, d: MjData, id: int, result: _Array) -> None: ...
def mj_forward(m: MjModel, d: MjData) -> None: ...
def mj_fullM(m: MjModel, d: MjData, dst: _Array) -> None: ...
def mj_getState(m: MjModel, d: MjData, state: _Array, sig: int) -> None: ...
def mj_jacBody(m: MjModel, d: MjData, jacp: _Array | None, jacr: _Array | None, body: int) -> None: ...
def mj_jacSite(m: MjModel, d: MjData, jacp: _Array | None, jacr: _Array | None, site: int) -> None: ...
def mj_mulJacTVec(m: MjModel, d: MjData, res: _Array, vec: _Array) -> None: ...
def mj_id2name(m: MjModel, type: int, id: int) -> str | None: ...
def mj_name2id(m: MjModel, type: int, name: str) -> int: ...
def mj_setConst(m: MjModel, d: MjData) -> None: ...
def mj_saveModel(m: MjModel, filename: str | None = ..., buffer: NDArray[np.uint8] | None = ...) -> None: ...
def mj_setState(m: MjModel, d: MjData, state: _Array, sig: int) -> None: ...
def mj_stateSize(m: MjModel, sig: int) -> int: ...
def mj_step(m: MjModel, d: MjData, nstep: int = ...) -> None: ...
def mj_step1(m: MjModel, d: MjData) -> None: ...
def mj_step2(m: MjModel, d: MjData) -> None: ...
def mju_mulPose(
    posres: _Array, quatres: _Array, pos1: _Array, quat1: _Array, pos2: _Array, quat2: _Array
) -> None: ...
def mju_mulQuat(res: _Array, qa: _Array, qb: _Array) -> None: ...
def mju_negQuat(res: _Array, quat: _Array) -> None: ...
def mju_rayGeom(pos: _Array, mat: _Array, size: _Array, pnt: _Array, vec: _Array, geomtype: int) -> float: ...
def mju_rotVecQuat(res: _Array, vec: _Array, quat: _Array) -> None: ...
def mju_quatZ2Vec(quat: _Array, vec: _Array) -> None: ...
def mju_subQuat(res: _Array, qa: _Array, qb: _Array) -> None: ...
def set_mju_user_warning(handler: Callable[[str], None]) -> None: ...

class mjtConstraint(IntEnum):
    mjCNSTR_EQUALITY = ...

class mjtTexture(IntEnum):
    mjTEXTURE_2D = ...
    mjTEXTURE_SKYBOX = ...

class mjtTextureRole(IntEnum):
    mjTEXROLE_RGB = ...

class mjtBuiltin(IntEnum):
    mjBUILTIN_CHECKER = ...
    mjBUILTIN_GRADIENT = ...

class mjtStereo(IntEnum):
    mjSTEREO_SIDEBYSIDE = ...

class mjtRndFlag(IntEnum):
    mjRND_SHADOW = ...
    mjRND_REFLECTION = ...

class mjtFramebuffer(IntEnum):
    mjFB_OFFSCREEN = ...

class mjtFontScale(IntEnum):
    mjFONTSCALE_50 = ...

class mjtCatBit(IntEnum):
    mjCAT_STATIC = ...
    mjCAT_DYNAMIC = ...

class _VisualGlobal:
    offwidth: int
    offheight: int

class _VisualQuality:
    offsamples: int
    shadowsize: int

class MjVisual:
    global_: _VisualGlobal
    quality: _VisualQuality

class MjStatistic:
    center: _Array
    extent: float
    meaninertia: float

class MjvOption:
    sitegroup: NDArray[np.uint8]

class MjvCamera:
    lookat: _Array
    distance: float
    azimuth: float
    elevation: float

class MjvGLCamera:
    pos: _Numbers
    forward: _Numbers
    up: _Numbers
    frustum_center: float
    frustum_bottom: float
    frustum_top: float
    frustum_near: float
    frustum_far: float
    orthographic: int

class MjvLight:
    pos: _Numbers
    dir: _Numbers
    headlight: int

class MjvGeom:
    size: _Array
    emission: float
    specular: float

class MjvScene:
    maxgeom: int
    ngeom: int
    geoms: tuple[MjvGeom, ...]
    lights: tuple[MjvLight, ...]
    stereo: int
    flags: NDArray[np.uint8]
    camera: tuple[MjvGLCamera, MjvGLCamera]
    def __init__(self, model: MjModel, maxgeom: int) -> None: ...

class MjrContext:
    def __init__(self, model: MjModel, fontscale: mjtFontScale) -> None: ...
    def free(self) -> None: ...

class MjrRect:
    def __init__(self, left: int, bottom: int, width: int, height: int) -> None: ...

def mjr_readPixels(
    rgb: NDArray[np.uint8] | None, depth: NDArray[np.float32] | None, viewport: MjrRect, con: MjrContext
) -> None: ...
def mjr_render(viewport: MjrRect, scn: MjvScene, con: MjrContext) -> None: ...
def mjr_setBuffer(framebuffer: int, con: MjrContext) -> None: ...
def mjv_initGeom(
    geom: MjvGeom, type: int, size: _Array, pos: _Array, mat: _Array, rgba: NDArray[np.float32]
) -> None: ...
def mjv_defaultFreeCamera(m: MjModel, cam: MjvCamera) -> None: ...
def mjv_updateScene(
    m: MjModel, d: MjData, opt: MjvOption, pert: None, cam: MjvCamera, catmask: int, scn: MjvScene
) -> None: ...
