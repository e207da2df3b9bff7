"""Reads mission files: documents with places, their repair, and the tree that is built from them.
"""
