"""The program that shows a run: it reads its lines, and serves the page and Groot2's protocol"""
