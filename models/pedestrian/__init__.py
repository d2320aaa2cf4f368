"""The pedestrian: growth, anthropometry, joints, tissue and running posture."""
