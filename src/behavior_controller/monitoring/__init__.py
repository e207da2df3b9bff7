"""Shows a running mission: story, page, ``missionStatus``, Groot2, record."""
