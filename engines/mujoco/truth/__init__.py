"""Truth beside pictures: depth, segmentation, normals, flow and keypoints, from the geometry of a scene."""
