"""The FMU engine: any FMI 2.0 or 3.0 co-simulation FMU as a participant."""
