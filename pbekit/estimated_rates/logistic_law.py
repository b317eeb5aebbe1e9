"""How likely an encounter ends in each way, by sizes and shapes of both: a multinomial logistic regression with its posterior."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import optimize, special


@dataclass(frozen=True)
class LogisticLaw:
    """ln(p_k/p_0) = polynomial in ln sizes and shapes, symmetric in the two; ridge prior, Laplace posterior.

    coefficients : (kinds - 1, features); covariance : of the flattened coefficients

    Examples
    --------
    >>> import pbekit
    >>> from pbekit.estimated_rates import EstimatedRates
    >>> table = pbekit.open_table("notebooks/data/designed-1000Pa.nc")
    >>> law = EstimatedRates(table, pbekit.Grid.primaries(exact_to=16)).law
    >>> law.coefficients.shape[0] + 1, law.covariance.shape[0] == law.coefficients.size
    (3, True)
    """

    coefficients: np.ndarray
    covariance: np.ndarray
    centre: np.ndarray
    scale: np.ndarray

    @staticmethod
    def features(
        size_i: np.ndarray, size_j: np.ndarray, shape_i: np.ndarray, shape_j: np.ndarray
    ) -> np.ndarray:
        """(..., features) from sizes and shapes (nan where there is only one) of both."""
        size_i, size_j = np.log(size_i), np.log(size_j)
        total = np.log(np.exp(size_i) + np.exp(size_j))
        unlike = np.abs(size_i - size_j)
        mean = 0.5 * (size_i + size_j)
        s_i, s_j = np.nan_to_num(np.log(shape_i)), np.nan_to_num(np.log(shape_j))
        shape, diff = s_i + s_j, np.abs(s_i - s_j)
        return np.stack(
            [total, total**2, unlike, unlike**2, mean * unlike, shape, diff, shape * total], axis=-1
        )

    @classmethod
    def fit(
        cls, features: np.ndarray, kind: np.ndarray, kinds: int = 3, weight: np.ndarray | None = None
    ) -> LogisticLaw:
        """Posterior mode by Newton's method.

        weight : (n,) of each encounter.  Their likelihood counts as that of as many as carry it, (sum w)^2/sum w^2 (Kish 1965)
        """
        w = np.ones(len(features)) if weight is None else weight * (weight.sum() / (weight**2).sum())
        centre = features.mean(axis=0)
        scale = np.where(features.std(axis=0) > 1e-9, features.std(axis=0), 1.0)
        x = np.concatenate([np.ones((len(features), 1)), (features - centre) / scale], axis=1)
        one = np.eye(kinds)[kind][:, 1:]
        m = x.shape[1]
        ridge = np.tile(np.r_[1 / 25, np.ones(m - 1) / 4], kinds - 1)

        @lru_cache(maxsize=2)
        def probabilities(point: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            """Probabilities (n, kinds - 1), the logarithm of their norm (n,) and what they are the softmax of."""
            logit = x @ np.frombuffer(point).reshape(kinds - 1, m).T
            highest = np.maximum(logit.max(axis=1), 0.0)
            p = np.exp(logit - highest[:, None])
            norm = np.exp(-highest) + p.sum(axis=1)
            return p / norm[:, None], np.log(norm) + highest, logit

        def objective(flat: np.ndarray) -> tuple[float, np.ndarray]:
            p, norm, logit = probabilities(flat.tobytes())
            value = (w * norm).sum() - (w[:, None] * one * logit).sum() + 0.5 * (ridge * flat**2).sum()
            return value, (x.T @ (w[:, None] * (p - one))).T.ravel() + ridge * flat

        def hessian(flat: np.ndarray) -> np.ndarray:
            p, _, _ = probabilities(flat.tobytes())
            found = np.diag(ridge)
            for a, b in itertools.combinations_with_replacement(range(kinds - 1), 2):
                block = x.T @ (x * (w * p[:, a] * ((a == b) - p[:, b]))[:, None])
                found[a * m : (a + 1) * m, b * m : (b + 1) * m] += block
                if a != b:
                    found[b * m : (b + 1) * m, a * m : (a + 1) * m] += block
            return found

        start = np.zeros((kinds - 1) * m)
        found = optimize.minimize(objective, start, jac=True, hess=hessian, method="trust-exact", tol=1e-8)
        return cls(found.x.reshape(kinds - 1, m), np.linalg.inv(hessian(found.x)), centre, scale)

    def expected(self, features: np.ndarray) -> np.ndarray:
        """(..., kinds) posterior mean of the probabilities: where little is known it is not that of the mode.

        Over 16 draws in pairs of opposite sign about the mode.
        """
        rng = np.random.default_rng(0)
        root = np.linalg.cholesky(self.covariance)
        total: np.ndarray | float = 0.0
        for _ in range(8):
            step = (root @ rng.standard_normal(len(root))).reshape(self.coefficients.shape)
            for sign in (1, -1):
                law = LogisticLaw(self.coefficients + sign * step, self.covariance, self.centre, self.scale)
                total = total + law(features) / 16
        return np.asarray(total)

    def drawn(self, rng: np.random.Generator) -> LogisticLaw:
        """The law with coefficients drawn from the posterior."""
        flat = rng.multivariate_normal(self.coefficients.ravel(), self.covariance, method="cholesky")
        return LogisticLaw(flat.reshape(self.coefficients.shape), self.covariance, self.centre, self.scale)

    def __call__(self, features: np.ndarray) -> np.ndarray:
        """(..., kinds) probabilities."""
        x = (features - self.centre) / self.scale
        logit = np.einsum("...f,kf->...k", x, self.coefficients[:, 1:]) + self.coefficients[:, 0]
        return special.softmax(np.concatenate([np.zeros((*logit.shape[:-1], 1)), logit], axis=-1), axis=-1)
