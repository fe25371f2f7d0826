#include "pipeline/machine/materials.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/text/key_text.h"

namespace lamina::pipeline {
namespace {

constexpr std::size_t kLongestName = 40;

Error wrong(const std::string& what) { return {Fault::kUsage, "part.material: " + what}; }

std::string names_text(const std::vector<JobMaterial>& materials) {
  std::string text;
  for (const JobMaterial& material : materials) text += (text.empty() ? "" : ", ") + material.name;
  return text;
}

/// Numbers the materials as parts name them.
class Naming {
 public:
  explicit Naming(const Machine* machine) : machine_(machine) {}

  /// errors  a name that no vat has
  Result<std::uint32_t> number_of(const std::string& name, const std::string& part) {
    for (std::uint32_t i = 0; i < used.size(); ++i) {
      if (used[i].name == name) return i;
    }
    JobMaterial material{name, static_cast<std::uint32_t>(used.size())};
    if (machine_ != nullptr && !machine_->powder.materials.empty()) {
      const auto& vats = machine_->powder.materials;
      const auto vat = std::ranges::find(vats, name) - vats.begin();
      if (vat == static_cast<std::ptrdiff_t>(vats.size())) {
        const std::vector<std::string_view> names(vats.begin(), vats.end());
        return wrong(fmt::format("{}: no vat of {} holds it: {}", part, machine_->name, not_one_of(name, names)));
      }
      material.vat = static_cast<std::uint32_t>(vat);
    }
    used.push_back(material);
    return static_cast<std::uint32_t>(used.size() - 1);
  }

  std::vector<JobMaterial> used;

 private:
  const Machine* machine_;
};

}  // namespace

std::string read_material(std::string_view text, std::string& name) {
  const bool good = !text.empty() && text.size() <= kLongestName && std::ranges::all_of(text, [](unsigned char c) {
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '-' || c == '_';
  });
  if (!good) return fmt::format("'{}' is no name of a material; use up to {} letters, digits, - and _", text, kLongestName);
  name = text;
  return {};
}

Status set_materials(std::string_view text, Job& job) {
  const auto names = split(text, ",");
  if (names.size() != 1 && names.size() != job.parts.size()) {
    return Error{Fault::kUsage,
                 fmt::format("{} names for {} parts; give one for all or one for each", names.size(), job.parts.size())};
  }
  for (std::size_t p = 0; p < job.parts.size(); ++p) {
    const auto name = names[names.size() == 1 ? 0 : p];
    if (const std::string what = read_material(name, job.parts[p].material); !what.empty()) {
      return Error{Fault::kUsage, what};
    }
  }
  return {};
}

std::string read_material_ranges(std::string_view text, std::vector<MaterialRange>& ranges) {
  ranges.clear();
  for (std::string_view piece : split(text, ";")) {
    while (piece.starts_with(' ')) piece.remove_prefix(1);
    while (piece.ends_with(' ')) piece.remove_suffix(1);
    const std::size_t gap = piece.find(' ');
    const auto ends = split(piece.substr(0, gap), ":");
    MaterialRange range;
    if (gap == std::string_view::npos || ends.size() != 2) return fmt::format("'{}' is no range; write 2:4.5 bronze", piece);
    for (const auto& [end, value] : {std::pair{ends[0], &range.from_mm}, {ends[1], &range.to_mm}}) {
      if (auto what = read_number(end, 0, kMostMm, " mm", *value); !what.empty()) return what;
    }
    if (range.from_mm >= range.to_mm) return fmt::format("'{}' ends where it begins, or below", piece);
    if (auto what = read_material(piece.substr(piece.find_last_of(' ') + 1), range.material); !what.empty()) return what;
    ranges.push_back(range);
  }
  return {};
}

std::uint32_t PartMaterial::at(Nm plane) const {
  std::uint32_t material = elsewhere;
  for (const Range& range : ranges) {
    if (plane >= range.from && plane < range.to) material = range.material;
  }
  return material;
}

Result<Materials> materials_of(const Job& job) {
  Materials result;
  const auto named = [](const PartRequest& part) { return !part.material.empty(); };
  result.part.resize(job.parts.size());
  const bool any = std::ranges::any_of(job.parts, named);
  for (const PartRequest& part : job.parts) {
    if (named(part) || (!any && part.material_by_height.empty())) continue;
    return wrong(fmt::format("{}: has none; name that of every part, or of none", part.path));
  }
  if (!any) return result;
  const Machine* machine = job.machine.resolved ? &job.machine.resolved->machine : nullptr;
  Naming naming(machine);
  for (std::size_t p = 0; p < job.parts.size(); ++p) {
    const PartRequest& part = job.parts[p];
    const auto elsewhere = naming.number_of(part.material, part.path);
    if (!elsewhere) return elsewhere.error();
    result.part[p].elsewhere = *elsewhere;
    std::vector<MaterialRange> ranges;
    if (!part.material_by_height.empty()) read_material_ranges(part.material_by_height, ranges);  // checked with the job
    const std::int64_t bottom = nm_of(part.bottom_mm);
    for (const MaterialRange& range : ranges) {
      const auto number = naming.number_of(range.material, part.path);
      if (!number) return number.error();
      result.part[p].ranges.push_back({bottom + nm_of(range.from_mm), bottom + nm_of(range.to_mm), *number});
    }
  }
  if (machine != nullptr && naming.used.size() > machine->powder.vats) {
    return wrong(fmt::format("the parts are of {} materials ({}), {} has {}; plan them as several jobs", naming.used.size(),
                             names_text(naming.used), machine->name,
                             machine->powder.vats == 1 ? "one vat" : fmt::format("{} vats", machine->powder.vats)));
  }
  // In the order of the vats, whoever is named first.
  std::vector<std::uint32_t> order(naming.used.size()), place(order.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::sort(order, {}, [&](std::uint32_t i) { return naming.used[i].vat; });
  result.used.clear();
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    place[order[i]] = i;
    result.used.push_back(naming.used[order[i]]);
  }
  for (PartMaterial& part : result.part) {
    part.elsewhere = place[part.elsewhere];
    for (PartMaterial::Range& range : part.ranges) range.material = place[range.material];
  }
  return result;
}

Result<std::vector<std::uint32_t>> vats_of_layer(const Machine& machine, const Materials& materials,
                                                 std::span<const std::uint64_t> pixels) {
  std::vector<std::uint32_t> present;
  for (std::uint32_t m = 0; m < pixels.size(); ++m) {
    if (pixels[m] > 0) present.push_back(m);
  }
  const auto vat = [&](std::uint32_t material) { return materials.used[material].vat; };
  if (present.empty()) return std::vector<std::uint32_t>{vat(0)};
  if (present.size() == 1) return std::vector<std::uint32_t>{vat(present[0])};
  switch (machine.powder.vat_rule) {
    case VatRule::kFirst: return std::vector<std::uint32_t>{0};
    case VatRule::kSecond: return std::vector<std::uint32_t>{1};
    case VatRule::kMajority: return std::vector<std::uint32_t>{vat(pixels[1] > pixels[0] ? 1 : 0)};
    case VatRule::kBoth: return std::vector<std::uint32_t>{0, 1};
    case VatRule::kRefuse: break;
  }
  return Error{Fault::kUsage, fmt::format("holds {}, which powder.vat_rule of {} refuses; choose another rule, or move the "
                                          "parts to other heights",
                                          names_text(materials.used), machine.name)};
}

}  // namespace lamina::pipeline
