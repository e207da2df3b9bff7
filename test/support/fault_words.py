"""What faults say, as an author reads it."""


def in_words(faults):
    """Return the text and the hint of each fault."""
    return ["{} ({})".format(fault.text, fault.hint) for fault in faults]


def unsaid(words, faults):
    """Return those of the words that none of the faults says."""
    said = "\n".join(in_words(faults))
    return [word for word in words if word not in said]
