"""Writing recordings: the pipeline's input and output, as MCAP files with ROS 2 messages.

``messages`` turns records into messages, ``schemas`` defines their types, ``qos`` says how they are played, ``ring``
keeps the last seconds, ``recording_file`` writes one file that a power cut leaves readable, ``destination`` names the
files and keeps their limits. The threads that do it while the vehicle drives are the daemon's.
"""
