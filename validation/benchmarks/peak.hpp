#pragma once

/// One core's own peak [flop/s], beside which rates stand: fused multiply-adds in double precision on the
/// widest vectors. Of the fastest of many short runs, which what else the machine does disturbs less.
[[nodiscard]] double measure_peak();
