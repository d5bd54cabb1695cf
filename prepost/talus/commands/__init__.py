"""The sub-commands of `talus`; each module has register(commands) and run functions."""
