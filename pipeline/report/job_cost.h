// pipeline/report/job_cost.h: what a job of a powder printer uses up and costs, layer by layer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/plan.h"
#include "pipeline/report/cost_report.h"
#include "pipeline/report/image_text.h"
#include "pipeline/report/summary.h"

namespace lamina::pipeline {

/// Parts whose use is reported one by one: those of a job with several, and with prices or a requested table; else 1.
/// The plan has a machine.
std::size_t reported_parts(const Plan& plan);

/// Of a job with a machine.
class JobCost {
 public:
  explicit JobCost(const Plan& plan);
  /// Of a finished job, whose parts are separated if its layers say whose their pixels are.
  JobCost(const Machine& machine, const Manifest& manifest);

  /// drops, microseconds  of its print program, with the drops that are spat
  void add(const LayerRecord& record, std::uint64_t drops, std::int64_t microseconds);
  /// Lines, the fact "use" and the table; of a finished job of several materials with a saturation what each got, too.
  void report(Summary& summary) const;
  cost::Account::Rows rows() const { return account_.rows(); }

 private:
  cost::Account account_;
  std::vector<PowderDrops> powders_;
  double drop_pl_ = 0;
};

}  // namespace lamina::pipeline
