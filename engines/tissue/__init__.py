"""Organs of soft tissue as data, for every engine of tissue: meshes, shapes, materials, anchors."""
