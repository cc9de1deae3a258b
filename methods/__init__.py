"""The methods that are compared. A new one is a file here and an entry in `METHODS`."""

from envbench.method import Method
from methods.angular import Angular
from methods.shrm import SHRM

METHODS: dict[str, type[Method]] = {method.name: method for method in (Angular, SHRM)}
