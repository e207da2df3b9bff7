"""Simulated robot for testing the mission interpreter: nodes with a visitor in front of them, and a verdict.

Reading order: ``configuration``; ``journal``, where the simulated nodes write what they were asked; ``arrivals``,
``faults`` and ``visitor``, the three models; ``robot``, what each node answers and publishes; ``stage``, where all of
them play in virtual time; ``facts``, ``matching``, ``verdict`` and ``report``, what becomes of it; ``scenes``, ``findings``,
``survey`` and ``rehearse``, many plays of one mission and what they show. None of them knows ROS. ``parameters``, ``nodes``,
``controller``, ``reporter`` and ``launcher`` do: they are what the executables in ``nodes/`` and the launch file start.
"""
