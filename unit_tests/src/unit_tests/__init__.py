"""Simulated robot for testing the mission interpreter: nine nodes with a visitor in front of them, and a verdict.

Reading order: ``configuration``; ``journal``, where the simulated nodes write what they were asked; ``arrivals``,
``faults`` and ``visitor``, the three models; ``robot``, what each node answers; ``report``, the verdict; and last
``nodes``, the only module that knows ROS.
"""
