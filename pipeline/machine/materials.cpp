#include "pipeline/machine/materials.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/job/errors.h"
#include "pipeline/job/profiles/printer.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/value.h"

namespace lamina::pipeline {
namespace {

Error wrong(const std::string& what) { return {Fault::kUsage, "part.material: " + what}; }

std::string names_text(const std::vector<JobMaterial>& materials) {
  std::string text;
  for (const JobMaterial& material : materials) text += (text.empty() ? "" : ", ") + material.name;
  return text;
}

/// Adds the material of a part. errors  a name without a vat
Status use(const std::string& name, const std::string& part, const Machine* machine, std::vector<JobMaterial>& used) {
  if (std::ranges::find(used, name, &JobMaterial::name) != used.end()) return {};
  for (const JobMaterial& other : used) {
    if (const std::string what = check_case(other.name, name); !what.empty()) return wrong(fmt::format("{}: {}", part, what));
  }
  JobMaterial material{name, static_cast<std::uint32_t>(used.size())};
  if (machine != nullptr && !machine->powder.materials.empty()) {
    const auto& vats = machine->powder.materials;
    const auto vat = std::ranges::find(vats, name) - vats.begin();
    if (vat == static_cast<std::ptrdiff_t>(vats.size())) {
      const std::vector<std::string_view> names(vats.begin(), vats.end());
      return wrong(fmt::format("{}: no vat of {} holds it: {}", part, machine->name, not_one_of(name, names)));
    }
    material.vat = static_cast<std::uint32_t>(vat);
  }
  used.push_back(material);
  return {};
}

}  // namespace

std::uint32_t PartMaterial::at(Nm plane) const {
  std::uint32_t material = elsewhere;
  for (const MaterialInterval& range : ranges) {
    if (plane >= range.from && plane < range.to) material = range.material;
  }
  return material;
}

Result<Materials> materials_of(const Job& job, const Machine* machine) {
  Materials result;
  const auto named = [](const PartRequest& part) { return !part.material.empty(); };
  result.part.resize(job.parts.size());
  const bool any = std::ranges::any_of(job.parts, named);
  for (const PartRequest& part : job.parts) {
    if (named(part) || (!any && part.material_ranges.empty())) continue;
    return wrong(fmt::format("{}: has none; name that of every part, or of none", part.path));
  }
  if (!any) return result;
  result.used.clear();
  for (const PartRequest& part : job.parts) {
    if (Status status = use(part.material, part.path, machine, result.used); !status) return status.error();
    for (const MaterialRange& range : part.material_ranges) {
      if (Status status = use(range.material, part.path, machine, result.used); !status) return status.error();
    }
  }
  if (machine != nullptr && result.used.size() > machine->powder.vats) {
    return wrong(fmt::format("the parts are of {} materials ({}), {} has {}; plan them as several jobs", result.used.size(),
                             names_text(result.used), machine->name,
                             machine->powder.vats == 1 ? "one vat" : fmt::format("{} vats", machine->powder.vats)));
  }
  // In the order of the vats, not of the parts.
  std::ranges::sort(result.used, {}, &JobMaterial::vat);
  const auto number_of = [&](const std::string& name) {
    return static_cast<std::uint32_t>(std::ranges::find(result.used, name, &JobMaterial::name) - result.used.begin());
  };
  for (std::size_t p = 0; p < job.parts.size(); ++p) {
    const PartRequest& part = job.parts[p];
    const std::int64_t bottom = nm_of(part.bottom_mm.value_or(0));
    result.part[p].elsewhere = number_of(part.material);
    for (const auto& [from_mm, to_mm, material] : part.material_ranges) {
      result.part[p].ranges.push_back({bottom + nm_of(from_mm), bottom + nm_of(to_mm), number_of(material)});
    }
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
  std::string held;
  for (const std::uint32_t m : present) {
    held += fmt::format("{}{} pixels of {}", held.empty() ? "" : " and ", readable_count(pixels[m]), materials.used[m].name);
  }
  return usage(
      "{}, but {} feeds a layer from one vat; move the parts to other heights or into jobs of "
      "their own, or print it with --vat-rule majority, first, second or both",
      held, machine.name);
}

std::uint64_t unfed_pixels(const JobMaterial& material, std::span<const std::uint32_t> feeds, std::uint64_t pixels) {
  return std::ranges::find(feeds, material.vat) == feeds.end() ? pixels : 0;
}

}  // namespace lamina::pipeline
