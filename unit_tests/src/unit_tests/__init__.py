"""Simulated robot for testing the mission interpreter: nodes with a visitor in front of them, and a verdict.

Reading order: ``configuration``; ``journal``, where the simulated nodes write the requests they received; ``arrivals``,
``faults`` and ``visitor``, the three models; ``robot``, what each node answers and publishes; ``stage``, which runs all of
them in virtual time; ``facts``, ``matching``, ``verdict`` and ``report``, the evaluation of a test; ``scenes``, ``findings``,
``survey`` and ``rehearse``, many plays of one mission and their evaluation. None of them imports ROS. ``parameters``,
``nodes``, ``controller``, ``reporter`` and ``launcher`` do: the executables in ``nodes/`` and the launch file start them.
"""
