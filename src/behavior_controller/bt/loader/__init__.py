"""Reads mission files: documents with places, their repair, the checks, and the tree that is built
from them."""
