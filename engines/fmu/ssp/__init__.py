"""Systems of FMUs in files of the SSP standard, 1.0 and 2.0: import as a scenario, export of a scenario."""
