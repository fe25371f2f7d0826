#include "pipeline/report/part_info.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "stages/load/diagnosis/chunk_edges.h"
#include "stages/load/diagnosis/sound_survey.h"
#include "stages/load/repair/diagnose.h"
#include "stages/support/text/json_text.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

using load::Diagnosis;
using load::Known;
using load::LoadOptions;
using load::PlannedVolumes;
using load::SurplusAreas;

constexpr std::size_t kPositions = 3;
constexpr std::size_t kMeshesShown = 24;

struct Description {
  std::string format;
  Part part;                          // as in the file
  std::vector<Diagnosis> diagnosis;   // of each mesh
  std::vector<std::uint32_t> copies;  // of each mesh
  std::vector<Note> notes;            // of the part as planned
  PlannedVolumes planned;
  std::vector<double> capped_share;  // of each mesh as planned
  bool balanced = true;
  bool repairs = false;  // options.repair

  template <class Value>
  auto total(Value Diagnosis::*member) const {
    Value sum{};
    for (std::size_t i = 0; i < diagnosis.size(); ++i) sum += static_cast<Value>(copies[i]) * diagnosis[i].*member;
    return sum;
  }
  /// Of all meshes, by volume.
  double planned_on_caps() const {
    double capped = 0, all = 0;
    for (std::size_t i = 0; i < planned.of_mesh.size(); ++i) {
      all += copies[i] * planned.of_mesh[i].mm3;
      capped += copies[i] * planned.of_mesh[i].mm3 * capped_share[i];
    }
    return all > 0 ? capped / all : 0;
  }
};

/// Repair may change it, or refuse it.
bool may_change(const Description& description) {
  return !description.balanced || description.total(&Diagnosis::inverted_shells) > 0 ||
         std::any_of(description.diagnosis.begin(), description.diagnosis.end(),
                     [](const Diagnosis& found) { return found.volume_mm3 <= 0 || found.non_manifold_edges.count > 0; });
}

/// The volumes of a part as planned.
Status plan(const Part& part, std::span<const Diagnosis> diagnosis, const SurplusAreas& surplus, Description& description) {
  Result<PlannedVolumes> volumes = load::planned_volumes(part.meshes, part.instances, diagnosis, surplus);
  if (!volumes) return volumes.error();
  description.planned = std::move(*volumes);
  for (const Mesh& mesh : part.meshes) description.capped_share.push_back(mesh.capped_share);
  return {};
}

/// Loads a part as it is in the file and diagnoses it. Of a mesh in one file that is sound, and whose shells are apart, no list
/// is ever made. `sound` is true then: repair would change nothing.
Result<Part> load_and_diagnose(const std::string& path, const LoadOptions& options, Description& description, bool& sound) {
  load::DegenerateFacets degenerate(kPositions);
  load::SoundSurvey survey;
  LoadOptions as_is = options;
  as_is.repair = false;
  as_is.blocks = as_is.shown_only = true;
  Result<Part> part = load::load(path, as_is, [&](std::uint32_t first, std::span<const Triangle> facets) {
    degenerate.inspect(first, facets);
    return survey.inspect(facets);
  });
  if (!part) return part;
  as_is.blocks = false;
  sound = false;
  if (part->meshes.size() == 1 && part->meshes.front().triangles.empty()) {
    std::optional<Diagnosis> found = survey.finish();
    sound = found.has_value();
    if (!sound || !found->shells_apart) part = load::load(path, as_is);
    if (!part) return part;
    if (sound) {
      found->degenerate_facets = degenerate.finding();
      description.diagnosis.push_back(std::move(*found));
    }
  }
  description.copies.resize(part->meshes.size(), 0);
  for (const Instance& instance : part->instances) ++description.copies[instance.mesh];
  if (sound) return part;
  const bool alone = part->instances.size() == 1;  // the lists of others may be sliced together
  for (Mesh& mesh : part->meshes) {
    description.diagnosis.push_back(alone ? load::diagnose_alone(mesh, kPositions) : load::diagnose(mesh, kPositions));
    description.balanced = description.balanced && description.diagnosis.back().balanced;
  }
  return part;
}

Result<Description> describe(const std::string& path, const LoadOptions& options, const SurplusAreas& surplus) {
  const Result<std::string> format = load::format_of(path, options);
  if (!format) return format.error();
  Description description;
  description.format = *format;
  description.repairs = options.repair;
  bool sound = false;
  Result<Part> part = load_and_diagnose(path, options, description, sound);
  if (!part) return part.error();
  description.notes = part->notes;
  description.part = std::move(*part);
  if (sound || !may_change(description) || !options.repair) {
    if (const Status done = plan(description.part, description.diagnosis, surplus, description); !done) return done.error();
    return description;
  }
  for (Mesh& mesh : description.part.meshes) Buffer<Triangle>().swap(mesh.triangles);
  Result<Part> planned = load::load(path, options);
  if (!planned) return planned.error();
  if (planned->meshes.size() != description.copies.size())
    return Error{Fault::kInput, path + ": changed while it was read; run it again"};
  description.notes = std::move(planned->notes);
  std::vector<Diagnosis> diagnosis;
  const bool alone = planned->instances.size() == 1;
  for (Mesh& mesh : planned->meshes) diagnosis.push_back(alone ? load::diagnose_alone(mesh, 0) : load::diagnose(mesh, 0));
  if (const Status done = plan(*planned, diagnosis, surplus, description); !done) return done.error();
  return description;
}

struct PartKind {
  const char* name;
  const char* key;
  Diagnosis::Finding Diagnosis::*finding;
};
constexpr std::array<PartKind, 5> kKinds{{
    {"open edges", "open_edges", &Diagnosis::open_edges},
    {"non-manifold edges", "non_manifold_edges", &Diagnosis::non_manifold_edges},
    {"misoriented edges", "misoriented_edges", &Diagnosis::misoriented_edges},
    {"degenerate facets", "degenerate_facets", &Diagnosis::degenerate_facets},
    {"duplicate facets", "duplicate_facets", &Diagnosis::duplicate_facets},
}};

std::uint64_t count_of(const Description& description, const PartKind& kind) {
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < description.diagnosis.size(); ++i)
    count += description.copies[i] * (description.diagnosis[i].*kind.finding).count;
  return count;
}

std::string size_of(const Box& box) {
  return fmt::format("{:.3f} x {:.3f} x {:.3f} mm", mm(box.width()), mm(box.depth()), mm(box.height()));
}

std::string point(const Point3& p) { return fmt::format("({:.3f}, {:.3f}, {:.3f})", mm(p.x), mm(p.y), mm(p.z)); }

/// What is behind the name of the file in a mesh's name.
std::string short_name(const Description& description, std::size_t mesh) {
  const std::string& name = description.part.meshes[mesh].name;
  const std::size_t prefix = description.part.path.size() + 2;
  return name.size() > prefix ? name.substr(prefix) : name;
}

void row(std::string& text, const char* label, const std::string& value) { text += fmt::format("  {:<20} {}\n", label, value); }

/// The first places of a kind in all meshes.
std::string first_positions(const Description& description, const PartKind& kind) {
  std::string text;
  std::size_t shown = 0;
  for (std::size_t i = 0; i < description.diagnosis.size() && shown < kPositions; ++i) {
    for (const auto& position : (description.diagnosis[i].*kind.finding).first) {
      if (shown == kPositions) break;
      text += fmt::format("{}{}", shown == 0 ? "" : "  ", point(position.at));
      if (description.diagnosis.size() > 1) text += " of mesh " + std::to_string(i + 1);
      ++shown;
    }
  }
  return text;
}

void describe_meshes(const Description& description, std::string& text) {
  text += "\n  mesh  copies   triangles  closed  size, name\n";
  for (std::size_t i = 0; i < description.diagnosis.size() && i < kMeshesShown; ++i) {
    const Diagnosis& found = description.diagnosis[i];
    text +=
        fmt::format("  {:>4}  {:>6}  {:>10}  {:<6}  {}, {}\n", i + 1, description.copies[i], readable_count(found.triangles),
                    found.balanced ? "yes" : "no", size_of(found.bounds), short_name(description, i));
  }
  if (description.diagnosis.size() > kMeshesShown)
    text += fmt::format("  and {} more\n", description.diagnosis.size() - kMeshesShown);
}

void describe_findings(const Description& description, std::string& text) {
  const auto inverted = description.total(&Diagnosis::inverted_shells);
  bool any = inverted > 0;
  for (const PartKind& kind : kKinds) any = any || count_of(description, kind) > 0;
  if (!any) return;
  text += "\n  found                     count  first positions, mm\n";
  for (const PartKind& kind : kKinds)
    if (const std::uint64_t count = count_of(description, kind); count > 0)
      text += fmt::format("  {:<20} {:>10}  {}\n", kind.name, readable_count(count), first_positions(description, kind));
  if (inverted > 0)
    text +=
        fmt::format("  {:<20} {:>10}  a hollow within a shell, or a shell turned inside out\n", "inverted shells", inverted);
}

void describe_plan(const Description& description, std::string& text) {
  std::vector<const Note*> remarks, repairs;
  for (const Note& note : description.notes) (note.repair ? repairs : remarks).push_back(&note);
  if (!remarks.empty()) text += "\n  notes\n";
  for (const Note* note : remarks) text += "    " + one_line(note->text) + "\n";
  text += "\n  lamina jet ";
  if (repairs.empty() && (description.balanced || description.repairs)) {
    text += "plans it as it is.\n";
  } else if (!description.balanced && !description.repairs) {
    text += "plans it as it is, since repair is off; rows that stay open are reported.\n";
  } else {
    text += "plans it after these changes:\n";
  }
  for (const Note* note : repairs) text += "    " + one_line(note->text) + "\n";
}

/// How well a volume is known, for scripts.
const char* name_of(Known known) {
  return known == Known::kExactly ? "exact" : known == Known::kAbout ? "integrated" : "summed";
}

Json as_json(const Point3& p) { return {mm(p.x), mm(p.y), mm(p.z)}; }

Json as_json(const Diagnosis& found) {
  Json mesh;
  mesh["triangles"] = found.triangles;
  mesh["vertices"] = found.vertices;
  mesh["edges"] = found.edges;
  mesh["shells"] = found.shells;
  mesh["inverted_shells"] = found.inverted_shells;
  mesh["closed"] = found.balanced;
  mesh["bounds_mm"] = {{"lo", as_json(found.bounds.lo)}, {"hi", as_json(found.bounds.hi)}};
  mesh["volume_mm3"] = found.volume_mm3;
  for (const PartKind& kind : kKinds) {
    const auto& finding = found.*kind.finding;
    Json positions = Json::array();
    for (const auto& position : finding.first)
      positions.push_back({{"triangle", position.triangle + 1}, {"at_mm", as_json(position.at)}});
    mesh[kind.key] = {{"count", finding.count}, {"first", positions}};
  }
  return mesh;
}

}  // namespace

Result<std::string> describe_part_text(const std::string& path, const LoadOptions& options, const SurplusAreas& surplus) {
  const Result<Description> description = describe(path, options, surplus);
  if (!description) return description.error();
  const Description& d = *description;
  std::string text = one_line(path) + "\n";
  row(text, "format", d.format);
  if (d.part.instances.size() > 1 || d.part.meshes.size() > 1)
    row(text, "meshes", fmt::format("{}, placed {} times", d.part.meshes.size(), d.part.instances.size()));
  row(text, "triangles", readable_count(d.total(&Diagnosis::triangles)));
  row(text, "vertices", readable_count(d.total(&Diagnosis::vertices)));
  row(text, "shells", readable_count(d.total(&Diagnosis::shells)));
  row(text, "size", size_of(d.part.bounds));
  row(text, "from", point(d.part.bounds.lo) + " mm");
  row(text, "to", point(d.part.bounds.hi) + " mm");
  row(text, "volume",
      fmt::format("{:.6g} mm3{}", d.total(&Diagnosis::volume_mm3), d.balanced ? "" : " (of an open mesh: an estimate)"));
  row(text, "closed", d.balanced ? "yes" : "no");
  const double on_caps = d.planned_on_caps();
  row(text, "planned volume",
      fmt::format("{}{:.6g} mm3{}{}", d.planned.all.known == Known::kAbout ? "about " : "", d.planned.all.mm3,
                  d.planned.all.known == Known::kSummed && d.balanced ? " (what overlaps counts as often as it does)" : "",
                  on_caps > 0 ? fmt::format(", {:.3g} % of the surface is caps of openings: a guess", 100 * on_caps) : ""));
  if (d.diagnosis.size() > 1) describe_meshes(d, text);
  describe_findings(d, text);
  describe_plan(d, text);
  return text;
}

Result<std::string> describe_part_json(const std::string& path, const LoadOptions& options, const SurplusAreas& surplus) {
  const Result<Description> description = describe(path, options, surplus);
  if (!description) return description.error();
  const Description& d = *description;
  Json json;
  json["path"] = path;
  json["format"] = d.format;
  json["items"] = d.part.instances.size();
  json["triangles"] = d.total(&Diagnosis::triangles);
  json["vertices"] = d.total(&Diagnosis::vertices);
  json["shells"] = d.total(&Diagnosis::shells);
  json["inverted_shells"] = d.total(&Diagnosis::inverted_shells);
  json["bounds_mm"] = {{"lo", as_json(d.part.bounds.lo)}, {"hi", as_json(d.part.bounds.hi)}};
  json["volume_mm3"] = d.total(&Diagnosis::volume_mm3);
  json["closed"] = d.balanced;
  json["planned_volume_mm3"] = d.planned.all.mm3;
  json["planned_volume_is"] = name_of(d.planned.all.known);
  json["capped_share"] = d.planned_on_caps();
  json["notes"] = Json::array();
  json["repairs"] = Json::array();
  for (const Note& note : d.notes) json[note.repair ? "repairs" : "notes"].push_back(note.text);
  json["meshes"] = Json::array();
  for (std::size_t i = 0; i < d.diagnosis.size(); ++i) {
    Json mesh = as_json(d.diagnosis[i]);
    mesh["name"] = short_name(d, i);
    mesh["copies"] = d.copies[i];
    mesh["planned_volume_mm3"] = d.planned.of_mesh[i].mm3;
    mesh["capped_share"] = d.capped_share[i];
    json["meshes"].push_back(std::move(mesh));
  }
  // Names in a file may be bytes that are not UTF-8.
  return json_line(json);
}

}  // namespace lamina::pipeline
