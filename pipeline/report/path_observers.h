// pipeline/report/path_observers.h: what jobs of contours and of moves count, layer by layer, for their summaries.
#pragma once

#include "pipeline/plan/plan.h"
#include "pipeline/report/observer.h"
#include "stages/slice/slice.h"

namespace lamina::pipeline {

/// In the order of their lines. The plan must outlive them.
void observe_contours(const Plan& plan, Observers<slice::SectionReport>& observers);

/// Whether layers can have several segmented ranges of heights: parts stand at different heights, or layers continue above
/// the top of one.
bool has_ranges_by_layer(const Plan& plan);

/// In the order of their lines. The plan must outlive them. sums  of all layers so far, which the caller adds up
void observe_moves(const Plan& plan, const PathFacts& sums, Observers<void>& observers);

/// Adds what is known before the first move: the printer, its bead and the tolerance.
void report_move_plan(const Plan& plan, Summary& summary);

}  // namespace lamina::pipeline
