class SimpleType:
    unit: str | None

class Unit:
    name: str

class CoSimulation:
    modelIdentifier: str
    canHandleVariableCommunicationStepSize: bool
    canInterpolateInputs: bool
    canBeInstantiatedOnlyOncePerProcess: bool
    canGetAndSetFMUstate: bool
    canSerializeFMUstate: bool
    hasEventMode: bool
    providesDirectionalDerivative: bool

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
    modelVariables: list[ModelVariable]
    unitDefinitions: list[Unit]
    buildConfigurations: list[BuildConfiguration]

class ValidationError(Exception):
    problems: list[str]
