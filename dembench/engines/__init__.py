"""WHO simulates: the engine contract, one file per engine, and the registry."""
