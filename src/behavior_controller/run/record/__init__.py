"""The record of a run: written, read, run again, and shown as a report."""
