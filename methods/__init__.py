"""The methods that are compared. A new one is a file here and an entry in `METHODS`."""

from envbench.method import Method
from methods.angular import Angular
from methods.cabral import Cabral
from methods.explicit import Explicit
from methods.irradiance import Irradiance
from methods.kautz_mccool import KautzMcCool
from methods.ldprt import LDPRT, BentNormal, GlossyLDPRT, LinearLobe, SHRotation, StaticPRT, ZonalLight
from methods.monte_carlo import MonteCarlo
from methods.shrm import SHRM, SHRMCoefficients, SHRMGlobal
from methods.split_sum import SplitSum

_ALL = (
    SHRM, SHRMGlobal, SHRMCoefficients, Explicit, Angular, KautzMcCool, Cabral, Irradiance, SplitSum, MonteCarlo,
    LDPRT, GlossyLDPRT, LinearLobe, BentNormal, SHRotation, StaticPRT, ZonalLight,
)  # fmt: skip
METHODS: dict[str, type[Method]] = {method.name: method for method in _ALL}
