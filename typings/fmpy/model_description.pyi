class Item:
    name: str
    value: str | None

class SimpleType:
    unit: str | None
    items: list[Item]

class BaseUnit:
    kg: int
    m: int
    s: int
    A: int
    K: int
    mol: int
    cd: int
    rad: int
    factor: float
    offset: float

class Unit:
    name: str
    baseUnit: BaseUnit | None

class DefaultExperiment:
    stepSize: str | None
    tolerance: str | None

class InterfaceType:
    modelIdentifier: str
    canBeInstantiatedOnlyOncePerProcess: bool
    canGetAndSetFMUstate: bool
    canSerializeFMUstate: bool
    providesDirectionalDerivative: bool

class ModelExchange(InterfaceType):
    needsCompletedIntegratorStep: bool

class CoSimulation(InterfaceType):
    canHandleVariableCommunicationStepSize: bool
    canInterpolateInputs: bool
    hasEventMode: bool
    mightReturnEarlyFromDoStep: bool
    providesIntermediateUpdate: bool

class SourceFileSet:
    sourceFiles: list[str]

class BuildConfiguration:
    modelIdentifier: str | None
    sourceFileSets: list[SourceFileSet]

class Dimension:
    start: int
    variable: ModelVariable | None

class ModelVariable:
    name: str
    valueReference: int
    type: str
    description: str | None
    causality: str
    variability: str
    initial: str | None
    intervalVariability: str | None
    intervalDecimal: str | None
    shiftDecimal: str | None
    resolution: str | None
    intervalCounter: str | None
    shiftCounter: str | None
    clocks: list[ModelVariable] | None
    declaredType: SimpleType | None
    dimensions: list[Dimension]
    unit: str | None
    displayUnit: str | None
    sourceline: int
    start: str | None
    min: str | None
    max: str | None
    alias: ModelVariable | None

class ModelDescription:
    fmiVersion: str
    guid: str
    coSimulation: CoSimulation | None
    modelExchange: ModelExchange | None
    defaultExperiment: DefaultExperiment | None
    numberOfContinuousStates: int
    numberOfEventIndicators: int
    modelVariables: list[ModelVariable]
    unitDefinitions: list[Unit]
    buildConfigurations: list[BuildConfiguration]

class ValidationError(Exception):
    problems: list[str]
