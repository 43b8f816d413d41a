"""The simulation's compiled files; `assemble.py` puts them beside the stages of a catalogue."""
