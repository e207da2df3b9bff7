"""How ROS identifies a type."""
import hashlib


def md5(*lines):
    """Return the md5 of a message: a field of another message stands there with that one's md5 in
    place of its type."""
    return hashlib.md5("\n".join(lines).encode()).hexdigest()


def md5_of_service(lines):
    split = lines.index("---")
    return hashlib.md5(
        ("\n".join(lines[:split]) + "\n".join(lines[split + 1:])).encode()).hexdigest()
