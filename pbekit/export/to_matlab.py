"""MATLAB and GNU Octave: the arrays as .mat, and a script that solves the balance with them."""

from __future__ import annotations

import io

from scipy.io import savemat

from pbekit.export.arrays import arrays_of
from pbekit.export.target import MARK, HandOver, Target

SCRIPT = f"""% {MARK}: solves the balance of kernels.mat over time in MATLAB or GNU Octave
%   K, B   [m^3/s] aggregation, and encounters after which other aggregates are left, (S, S)
%   daughters      expected products in class k of an encounter of i and j, (S, S, S)
%   P, n0          primaries of each class; free primaries at the start [1/m^3]
function [t, n, mean_size] = solve_balance(file, t_end)
  if nargin < 1, file = 'kernels.mat'; end
  if nargin < 2, t_end = 300; end
  s = load(file);
  P = s.P(:);  S = numel(P);
  [i, j] = find(triu(ones(S)));                 % pairs i <= j
  pair = sub2ind([S S], i, j);
  once = 1 - 0.5 * (i == j);                    % a pair of equals is counted once
  a = zeros(numel(i), S);                       % aggregates on the pivots: number and mass are kept
  for r = 1:numel(i)
    m = P(i(r)) + P(j(r));
    if m >= P(S)
      a(r, S) = m / P(S);                       % beyond the last class: its mass is kept
    else
      k = find(P <= m, 1, 'last');
      w = (m - P(k)) / (P(k + 1) - P(k));
      a(r, k) = 1 - w;  a(r, k + 1) = w;
    end
  end
  d = reshape(s.daughters, S * S, S);
  out = sparse([1:numel(i), 1:numel(i)], [i; j], 1, numel(i), S);
  joined = (a - out)' * sparse(1:numel(i), 1:numel(i), once .* s.K(pair));
  broken = (d(pair, :) - out)' * sparse(1:numel(i), 1:numel(i), once .* s.B(pair));
  change = s.n0 / s.g * (joined + broken);      % in units of n0 and 1/g
  rate = @(t, n) change * (n(i) .* n(j));
  start = zeros(S, 1);  start(1) = 1;
  r = 1:numel(i);
  slope = @(t, n) full(change * (sparse(r, i, n(j), numel(i), S) + sparse(r, j, n(i), numel(i), S)));
  options = odeset('RelTol', 1e-6, 'AbsTol', 1e-12, 'Jacobian', slope);
  [t, n] = ode23s(rate, linspace(0, t_end * s.g, 201), start, options);
  t = t / s.g;  n = n * s.n0;
  mean_size = (n * P) ./ sum(n, 2);
  fprintf('t = %g s: <P> = %.6g, mass kept to %.1e\\n', t(end), mean_size(end), abs(n(end, :) * P / s.n0 - 1));
end
"""


def files(given: HandOver) -> dict[str, str | bytes]:
    """The arrays and the script."""
    held = io.BytesIO()
    arrays = {**arrays_of(given), "written_by": MARK}
    savemat(held, arrays, do_compression=False)
    return {"kernels.mat": held.getvalue(), "solve_balance.m": SCRIPT}


TARGET = Target(
    title="MATLAB and GNU Octave",
    files=files,
    notes={
        "kernels.mat": "K, B [m^3/s], daughters, P, R [m], and the start n0 [1/m^3], as arrays between classes",
        "solve_balance.m": "[t, n, mean_size] = solve_balance('kernels.mat', 300) solves the balance with ode23s",
    },
    cannot=("Shapes: the script knows sizes alone.",),
    check="[t, n, mean_size] = solve_balance(); plot(t, mean_size) beside course.csv: they must agree within its band.",
)
