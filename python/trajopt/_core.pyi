# The compiled core is private: its callers check what they get. See python/bindings.
from typing import Any

__version__: str

def __getattr__(name: str) -> Any: ...
