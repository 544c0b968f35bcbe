"""The topics and services of a gateway, independent of the middleware: tables, validation, publishing."""
