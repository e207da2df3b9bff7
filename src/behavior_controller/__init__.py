"""Robot Mission Interpreter: runs a mission drawn in Groot2 on the CSSR4Africa robot.

Reading order: ``errors``, ``keys`` and ``settings``; the engine in ``bt`` (``language`` -> ``checking`` -> ``compiler``
-> ``engine``); the requests of leaves to the robot in ``gateway``; the mission vocabulary in ``leaves``; loading a
mission in ``mission``; the tick loop in ``runner``; monitoring and records in ``watch``; and last ``ros``, the only
folder that imports ROS.
"""
