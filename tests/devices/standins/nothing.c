/* A library that is nobody's. */
int nothing(void) { return 0; }
