# What the maker of stubs does not see.
_core.__suffix__:
    class Error(RuntimeError):
        """What a caller got wrong, or a file. The text names what was found and what to do."""
    __version__: str
    added_filters: dict[str, str]
    format_version: int
    view_version: int
