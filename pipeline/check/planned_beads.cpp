#include "pipeline/check/planned_beads.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <tuple>
#include <utility>

#include "pipeline/check/job_files.h"
#include "pipeline/job/file.h"
#include "pipeline/output/temporary_folder.h"
#include "pipeline/run/run.h"
#include "stages/formats/gcode/read_gcode.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
using formats::GcodeFile;
using formats::GcodeLayer;

/// A bead of a layer; ends in whole micrometres, as they are written.
struct ComparedBead {
  std::int64_t from_x, from_y, to_x, to_y;
  std::uint32_t type;
  Nm width;
  double mm3;

  auto key() const { return std::tie(from_x, from_y, to_x, to_y, type); }
  bool operator<(const ComparedBead& other) const { return key() < other.key(); }
  double length_mm() const { return std::hypot(static_cast<double>(to_x - from_x), static_cast<double>(to_y - from_y)) / 1000; }
  /// E has five decimals: 2.4e-5 mm3, at both ends.
  bool same_volume(const ComparedBead& other) const {
    return width == other.width && std::abs(mm3 - other.mm3) <= 1e-4 + 1e-3 * other.mm3;
  }
};

std::int64_t micrometres(Nm nm) { return (std::int64_t{nm} + (nm >= 0 ? 500 : -500)) / 1000; }

/// Beads of one kind of difference in a layer.
struct BeadDifference {
  std::uint64_t count = 0;
  double length_mm = 0;
  ComparedBead first{};
  void add(const ComparedBead& bead) {
    if (count++ == 0) first = bead;
    length_mm += bead.length_mm();
  }
};

class BeadComparison {
 public:
  BeadComparison(const GcodeFile& file, const GcodeFile& plan, PlanComparison& result, Faults& faults)
      : file_(file), plan_(plan), result_(result), faults_(faults) {
    for (const std::string& name : file.types()) {
      const auto known = std::ranges::find(plan.types(), name);
      types_.push_back(static_cast<std::uint32_t>(known - plan.types().begin()));
    }
  }
  Status run();

 private:
  void load(const GcodeLayer& layer, bool of_file, std::vector<ComparedBead>& beads) const;
  void compare_layer(std::uint32_t index, const GcodeLayer& found, const GcodeLayer& planned);
  void report(std::uint32_t index, const BeadDifference& difference, std::string_view what);
  void lack(std::uint32_t index, const GcodeLayer& planned);

  const GcodeFile& file_;
  const GcodeFile& plan_;
  PlanComparison& result_;
  Faults& faults_;
  std::vector<std::uint32_t> types_;  // of the plan, by those of the file
  std::vector<ComparedBead> found_, planned_;
};

void BeadComparison::load(const GcodeLayer& layer, bool of_file, std::vector<ComparedBead>& beads) const {
  beads.clear();
  for (std::size_t i = 0; i < layer.beads.size(); ++i) {
    const formats::GcodeBead& bead = layer.beads[i];
    beads.push_back({micrometres(bead.from.x), micrometres(bead.from.y), micrometres(bead.to.x), micrometres(bead.to.y),
                     of_file ? types_[bead.type] : bead.type, bead.width, layer.feeds[i].volume_mm3});
  }
}

void BeadComparison::report(std::uint32_t index, const BeadDifference& difference, std::string_view what) {
  if (difference.count == 0) return;
  const auto& types = plan_.types();
  const std::string type = difference.first.type < types.size() ? types[difference.first.type] : "another type";
  faults_.add(fmt::format("layer {}: {}: {}, {:.3f} mm; the first, {}, at ({:.3f}, {:.3f}) mm", index, what, difference.count,
                          difference.length_mm, type, static_cast<double>(difference.first.from_x) / 1000,
                          static_cast<double>(difference.first.from_y) / 1000));
}

void BeadComparison::compare_layer(std::uint32_t index, const GcodeLayer& found, const GcodeLayer& planned) {
  load(found, true, found_);
  load(planned, false, planned_);
  result_.planned += planned_.size();
  const auto equal = [](const ComparedBead& a, const ComparedBead& b) { return a.key() == b.key(); };
  const bool same_order = std::ranges::equal(found_, planned_, equal);
  if (!same_order) {
    std::sort(found_.begin(), found_.end());
    std::sort(planned_.begin(), planned_.end());
  }
  BeadDifference missing, added, changed;
  std::size_t f = 0, p = 0;
  while (f < found_.size() || p < planned_.size()) {
    if (p == planned_.size() || (f < found_.size() && !same_order && found_[f] < planned_[p])) {
      added.add(found_[f++]);
    } else if (f == found_.size() || (!same_order && planned_[p] < found_[f])) {
      missing.add(planned_[p++]);
    } else {
      if (!found_[f].same_volume(planned_[p])) changed.add(found_[f]);
      ++f, ++p;
    }
  }
  report(index, missing, "missing beads");
  report(index, added, "beads that are not planned");
  report(index, changed, "beads of another width or volume");
  if (!same_order && missing.count + added.count == 0)
    faults_.add(fmt::format("layer {}: its beads are deposited in another order than planned", index));
  result_.missing += missing.count;
  result_.added += added.count;
  result_.changed += changed.count;
}

void BeadComparison::lack(std::uint32_t index, const GcodeLayer& planned) {
  faults_.add(fmt::format("layer {}: is missing, with {} beads at z {:g} mm", index, planned.beads.size(),
                          static_cast<double>(planned.z) * 1e-6));
  result_.planned += planned.beads.size();
  result_.missing += planned.beads.size();
}

/// Layers are compared by their heights: where one is missing, or there twice, the others are still compared.
Status BeadComparison::run() {
  std::uint32_t f = 0, p = 0;
  while (f < file_.count() || p < plan_.count()) {
    Result<GcodeLayer> found = f < file_.count() ? file_.layer(f, true) : GcodeLayer();
    Result<GcodeLayer> planned = p < plan_.count() ? plan_.layer(p, true) : GcodeLayer();
    if (!found) return found.error();
    if (!planned) return planned.error();
    if (f == file_.count() || (p < plan_.count() && found->z > planned->z)) {
      lack(p++, *planned);
    } else if (p == plan_.count() || found->z < planned->z) {
      faults_.add(fmt::format("layer {}: is not planned, with {} beads at z {:g} mm", f, found->beads.size(),
                              static_cast<double>(found->z) * 1e-6));
      result_.added += found->beads.size();
      ++f;
    } else {
      compare_layer(p, *found, *planned);
      ++f, ++p;
    }
  }
  return {};
}

/// The recorded job with its parts where they are now, written to a file. returns  why it cannot be planned; or empty
std::string job_again(const ManifestHead& head, const std::vector<std::string>& folders, const std::string& machine, Job& job) {
  if (Status status = read_job_text(head.job_toml, "manifest.json", job); !status) return status.error().message;
  for (PartRequest& part : job.parts) {
    const std::string name = fs::path(part.path).filename().string();
    part.path = find_part(name, folders);
    if (part.path.empty()) return fmt::format("{} was not found; name its folder by --parts", name);
  }
  if (!machine.empty()) job.machine.profile = machine;
  return {};
}

}  // namespace

Result<PlanComparison> compare_with_plan(const std::string& path, const ManifestHead& head,
                                         const std::vector<std::string>& folders, const std::string& machine, Faults& faults) {
  PlanComparison result;
  Job job;
  result.reason = job_again(head, folders, machine, job);
  if (!result.reason.empty()) return result;
  const TemporaryFolder folder("verify");
  if (Status status = folder.status(); !status) return status.error();
  job.output = folder.file("planned.gcode");
  job.overwrite = job.quiet = true;
  job.sync = Sync::kOff;
  const std::atomic<bool> never{false};
  const auto summary = run(
      job, Product::kMoves, [](const ProgressEvent&) {}, never);
  if (!summary) {
    result.reason = summary.error().message;
    return result;
  }
  const auto again = read_manifest(job.output + ".json");
  if (!again) return again.error();
  ManifestHead now = again->head;
  now.file = head.file;
  if (!same_job(now, head)) {
    result.reason = fmt::format("the job cannot be planned as it was: {}", difference(now, head));
    return result;
  }
  const auto file = GcodeFile::open(path), plan = GcodeFile::open(job.output);
  if (!file) return file.error();
  if (!plan) return plan.error();
  if (Status status = BeadComparison(*file, *plan, result, faults).run(); !status) return status.error();
  return result;
}

}  // namespace lamina::pipeline
