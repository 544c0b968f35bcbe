class SampleInfo:
    instance_state: int
    instance_handle: int
    publication_handle: int

class InvalidSample:
    sample_info: SampleInfo
