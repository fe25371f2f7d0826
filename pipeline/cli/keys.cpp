#include "pipeline/cli/keys.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/cli/outputs.h"
#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/machine/profiles.h"

namespace lamina::pipeline {
namespace {

/// The help headings for the options of a section; default "Bed and layers".
constexpr Word<std::string_view> kHeadings[] = {{"part", "Parts"},
                                                {"placement", "Parts"},
                                                {"slice", "Contours and files"},
                                                {"fill", "Filling"},
                                                {"extrude", "Extrusion"},
                                                {"machine", "Machine and binder"},
                                                {"dose", "Machine and binder"},
                                                {"load", "Repair"},
                                                {"run", "Run"}};

/// Options of the cited theses: layers by angle (Lima 2009), and segmented lines (Di Nisio 2022).
constexpr std::string_view kResearchFlags = "--adapt-angle --peaks --cover-top";

std::string_view heading_of(const KeyName& key) {
  const auto research = split(kResearchFlags, " ");
  if ((key.section == "segment" && key.flag != "--fill") || std::ranges::find(research, key.flag) != research.end())
    return "Research";
  std::string_view heading = key.flag == "--fill" ? "Filling" : "Bed and layers";
  read_word(kHeadings, key.section, heading);
  return heading;
}

bool has(std::string_view choice, const KeyName& key) {
  for (std::size_t begin = 0, end = 0; begin <= choice.size(); begin = end + 1) {
    end = std::min(choice.find(' ', begin), choice.size());
    std::string_view name = choice.substr(begin, end - begin);
    if (!name.starts_with(key.section)) continue;
    name.remove_prefix(key.section.size());
    if (name.empty() || (name.front() == '.' && name.substr(1) == key.name)) return true;
  }
  return false;
}

template <class Target>
void add_options(std::span<const Key<Target>> keys, std::string_view choice, const Target& presets, CommandSpec& spec) {
  for (const Key<Target>& key : keys) {
    if (key.flag.empty() || !has(choice, key)) continue;
    std::string preset = key.value.empty() ? std::string() : key.write(presets);
    if (key.section == "bed") std::ranges::replace(preset, ',', 'x');
    const auto words = key.words == nullptr ? std::vector<std::string_view>() : key.words();
    // Files may keep an older word for the default.
    if (!preset.empty() && !words.empty() && std::ranges::find(words, preset) == words.end()) preset = words.front();
    spec.options.push_back(
        {std::string(key.flag), std::string(key.value), std::string(key.meaning), preset, std::string(heading_of(key)), words});
  }
}

/// Mutually exclusive options.
Status check_together(std::string_view choice, const Arguments& arguments, const Job& job) {
  const std::string fill = arguments.text("--fill"), pattern = arguments.text("--pattern");
  if (has(choice, {"segment", "fill"}) && !fill.empty() && !pattern.empty() && fill != pattern && fill != "segmented")
    return at_option("--fill", fmt::format("{}, but --pattern {}: two patterns; give one of them", fill, pattern));
  if (pattern == "none" && job.segment.all.on)
    return at_option("--pattern", "none, but lines are segmented; leave it out, or add --fill none");
  if (job.segment.any()) return {};
  for (const JobKey& key : job_keys()) {
    if (key.section != "segment" || key.name == "fill" || key.name == "on" || key.flag.empty()) continue;
    if (arguments.has(key.flag) && has(choice, key))
      return at_option(key.flag, "applies to segmented lines, and nothing is segmented; add --fill segmented");
  }
  return {};
}

// Errors in the parts of a job file include their place in the file.
Status check_parts_of_file(const std::string& file, const Job& job) {
  if (job.parts.empty())
    return usage("{}: no part to plan; add a [[part]] with its path, or name parts on the command line", file);
  for (const PartRequest& part : job.parts) {
    std::error_code error;
    if (part.named_at.empty() || std::filesystem::exists(part.path, error)) continue;
    return failure(Fault::kInput, "{}: part.path: {}: no such file; correct it (relative paths start at the job file)",
                   part.named_at, part.path);
  }
  return {};
}

// --- options without effect

using heights::Mode;

bool fits_heights(Product, const Job& job) { return job.heights.mode != Mode::kUniform; }
bool by_angle(Product, const Job& job) { return job.heights.mode == Mode::kAngle; }
bool by_steps(Product product, const Job& job) { return fits_heights(product, job) && !by_angle(product, job); }
/// Optimal tables inspect all slopes in a layer.
bool by_slopes(Product product, const Job& job) { return fits_heights(product, job) && job.heights.mode != Mode::kOptimal; }
bool optimal(Product, const Job& job) { return job.heights.mode == Mode::kOptimal; }
bool may_end_below(Product product, const Job& job) { return by_angle(product, job) || optimal(product, job); }
bool scaled(Product, const Job& job) {
  const auto nominal = [](const PartRequest& part) { return part.shrink == std::array<double, 3>{1, 1, 1}; };
  return !std::ranges::all_of(job.parts, nominal);
}
bool shrinks(Product product, const Job& job) { return by_steps(product, job) && scaled(product, job); }
bool has_raft(Product, const Job& job) { return job.extrude.raft_layers > 0; }
bool is_on_bed(Product, const Job& job) { return job.extrude.raft_layers == 0; }
bool has_core(Product, const Job& job) { return job.dose.core < 1 || job.dose.core_saturation_percent || fills(job); }
bool dithers(Product, const Job& job) { return job.levels > 0 || job.dose.saturation_percent; }
/// Filament printers deposit a wall unless something else is requested.
bool deposits_beads(Product product, const Job& job) { return product == Product::kMoves || fills(job); }
/// Whether some heights or parts have a filling of their own.
bool varies_filling(const Job& job) {
  const auto plain = [](const PartRequest& part) { return part.fill.empty(); };
  return !job.fill.ranges.empty() || !std::ranges::all_of(job.parts, plain);
}
bool deposits_lines(Product, const Job& job) {
  return job.fill.all.pattern != infill::Pattern::kNone || job.segment.any() || varies_filling(job);
}
/// Skins are of a density below 100 %.
bool has_skins(Product product, const Job& job) {
  const auto& density = job.fill.all.density_percent;
  return (density && *density < 100) || (product == Product::kMoves && varies_filling(job));
}
/// Only curves that are not closed, and lines, are cut by a rule.
bool cuts_lines(Product, const Job& job) { return job.fill.all.pattern != infill::Pattern::kContour || varies_filling(job); }
bool lies_in_pairs(Product, const Job& job) { return job.segment.all.continuous > 1 || !job.segment.ranges.empty(); }

bool repairs(Product, const Job& job) { return job.repair; }
bool leaves_open(Product, const Job& job) { return !job.repair; }
bool arranges(Product, const Job& job) {
  return job.parts.size() > 1 ? !std::ranges::all_of(job.parts, [](const PartRequest& p) { return p.at_mm && p.copies == 1; })
                              : job.parts.empty() || job.parts.front().copies > 1;
}
bool turns_lines(Product, const Job& job) {
  return (job.fill.all.pattern != infill::Pattern::kNone && job.fill.all.pattern != infill::Pattern::kContour) ||
         job.segment.any() || varies_filling(job);
}
bool lacks_unit(Product, const Job& job) {
  const auto states = [](const PartRequest& part) { return lower_case(part.path).ends_with(".3mf"); };
  return job.parts.empty() || !std::ranges::all_of(job.parts, states);
}
bool has_first_bleed(Product, const Job& job) { return job.dose.first_bleed_um.has_value(); }
bool inspects(Product, const Job& job) { return job.inspect; }
bool has_machine(Product, const Job& job) { return !job.machine.profile.empty(); }
bool mixes_powders(Product, const Job& job) {
  return std::ranges::any_of(job.parts, [&](const PartRequest& part) {
    return !part.material_ranges.empty() || part.material != job.parts.front().material;
  });
}
bool writes_files(Product, const Job& job) { return job.slice.format != "null"; }
bool writes_tiff(Product, const Job& job) { return job.format.starts_with("tiff"); }
bool writes_cli(Product, const Job& job) { return job.slice.format.starts_with("cli"); }

struct Need {
  std::string_view flag;
  bool (*met)(Product, const Job&);
  std::string_view unmet;
  bool (*in_study)(Product, const Job&) = nullptr;  // of layers alone; nullptr: it affects any study
};
constexpr std::string_view kUniform =
                               "applies to layers that fit the part, and these are uniform; add --heights and --thickness",
                           kSteps = "applies to --heights cusp, stepwise and optimal; add one of them",
                           kSlopes = "applies to --heights angle, cusp and stepwise; add one of them",
                           kAngle = "applies to --heights angle; add it", kOptimal = "applies to --heights optimal; add it",
                           kCovered = "applies to --heights angle and optimal, the others reach the top; add one of them",
                           kShrinks =
                               "applies to steps on parts that shrink; add --shrink, and --heights cusp, stepwise or optimal",
                           kRaft = "applies to a raft, but there is none; add --raft",
                           kBeads = "applies to beads, but there are none; add --fill, --pattern or --walls",
                           kLines = "applies to lines, but there is no pattern; add --fill or --pattern",
                           kSparse = "applies to a filling by density, and there is none below 100 %; add --density",
                           kTurned = "applies to lines with a direction, but there are none; add --fill raster";
constexpr Need kNeeds[] = {
    {"--cusp", by_steps, kSteps},
    {"--cusp-of", shrinks, kShrinks, scaled},
    {"--adapt-angle", by_angle, kAngle, by_angle},
    {"--peaks", by_angle, kAngle, by_angle},
    {"--cover-top", may_end_below, kCovered, may_end_below},
    {"--peak-angle", fits_heights, kUniform},
    {"--facets", by_slopes, kSlopes, by_slopes},
    {"--facet-area", fits_heights, kUniform},
    {"--no-flats", optimal, kOptimal, optimal},
    {"--flat-area", fits_heights, kUniform},
    {"--flat-tolerance", fits_heights, kUniform},
    {"--time-model", optimal, kOptimal, optimal},
    {"--shell", has_core, "applies to a core of less binder, but there is none; add --core, --core-saturation or --fill"},
    {"--no-dither", dithers, "applies to fractions of drops, but there are none; add --levels or --saturation"},
    {"--raft-gap", has_raft, kRaft},
    {"--raft-margin", has_raft, kRaft},
    {"--elephant-foot", is_on_bed, "applies to parts on the bed, and --raft is between; leave one of them out"},
    {"--bead-ends", deposits_beads, kBeads},
    {"--bead", deposits_beads, kBeads},
    {"--bead-gap", deposits_lines, kLines},
    {"--line-distance", deposits_lines, kLines},
    {"--gap-formula", deposits_lines, kLines},
    {"--top-layers", has_skins, kSparse},
    {"--bottom-layers", has_skins, kSparse},
    {"--angle", turns_lines, kTurned},
    {"--angle-step", turns_lines, kTurned},
    {"--stagger", deposits_lines, kLines},
    {"--print-speed", deposits_lines, "applies to filling lines, but there is no pattern; add --fill, or use --wall-speed"},
    {"--segment-rule", cuts_lines,
     "applies to lines; closed curves are cut by their length under every rule; remove the option"},
    {"--spacing-cc", lies_in_pairs,
     "is between continuous lines, and one lies alone between segmented ones; add --continuous 2"},
    {"--bridge", leaves_open, "applies to open meshes, and repair closes them; add --no-repair"},
    {"--title", writes_tiff, "applies to TIFF, other formats have no tag for it; remove it, or add --format tiff-g4"},
    {"--weld", repairs, "applies to repair, which is off; leave out one of the two"},
    {"--gap", arranges, "applies to several parts that are arranged, and here are none; add --copies or another part"},
    {"--unit", lacks_unit, "applies to STL and OBJ, and 3MF files state their unit; leave it out"},
    {"--first-layers", has_first_bleed, "applies to --first-bleed, but there is none; add it"},
    {"--min-wall", inspects, "applies to --inspect; add it"},
    {"--allow-unbound", has_machine, "applies to the binder that a machine's powder needs; add --machine"},
    {"--vat-rule", mixes_powders, "applies to layers of two powders, but there is one; add --material"},
    {"--file-a-layer", writes_files, "applies to files, but --format null writes none; choose another format"},
    {"--empty-first-layer", writes_cli, "applies to CLI files; add --format cli or cli-binary"},
};

/// Options of what a printer that reads SML decides by itself: its files carry no heat, fans and speeds.
constexpr std::string_view kOfGcode[] = {"--nozzle-temperature", "--bed-temperature", "--retraction", "--fan",
                                         "--relative-extrusion", "--print-speed",     "--wall-speed", "--first-layer-speed",
                                         "--travel-speed",       "--material"};

/// Whether a key has an effect on this product; images are filled by beads.
bool decides_in(Product product, const JobKey& key, const Job& job) {
  if (key.decides == 0 || (key.decides & bit(product)) != 0) return true;
  return product == Product::kImages && fills(job) && (key.section == "fill" || key.section == "segment");
}

}  // namespace

void add_key_options(std::string_view choice, CommandSpec& spec) {
  spec.options.insert(spec.options.end(),
                      {{"--job", "FILE", "job file in TOML; options override its keys", "", "Job"},
                       {"--save-job", "FILE", "write the resolved job, for use with --job", "", "Job"},
                       {"--set", "KEY=VALUE", "set a job key, as in bed.dpi=600 or part.2.copies=3", "", "Job"}});
  add_options<Job>(job_keys(), choice, Job(), spec);
  add_options<PartRequest>(part_keys(), choice, PartRequest(), spec);
}

Result<Job> read_job_options(std::string_view choice, const Arguments& arguments) {
  Job job;
  if (arguments.has("--job")) {
    if (Status status = read_job(arguments.text("--job"), job); !status) return status.error();
  }
  if (!arguments.operands.empty()) {
    job.parts.clear();
    for (const std::string& path : arguments.operands) {
      job.parts.emplace_back();
      job.parts.back().path = path;
    }
  }
  for (const std::string& assignment : arguments.all("--set")) {
    if (Status status = set_key(job, assignment); !status) return status.error();
  }
  for (const JobKey& key : job_keys()) {
    if (key.flag.empty() || !arguments.has(key.flag) || !has(choice, key)) continue;
    const std::string text = key.value.empty() ? std::string(key.switch_text) : arguments.text(key.flag);
    if (Status status = at_option(key.flag, with_comma_hint(key.read(text, job), text)); !status) return status.error();
    job.named.push_back(fmt::format("{}.{}", key.section, key.name));
  }
  for (const PartKey& key : part_keys()) {
    if (key.flag.empty() || !arguments.has(key.flag) || !has(choice, key)) continue;
    if (key.flag == "--at" && job.parts.size() > 1) {
      return at_option(key.flag, fmt::format("is for a single part, here are {}; set at_mm of each [[part]] in a job file",
                                             job.parts.size()))
          .error();
    }
    PartRequest unused;
    const std::string text = arguments.text(key.flag);
    if (Status status = at_option(key.flag, with_comma_hint(key.read(text, unused), text)); !status) return status.error();
    for (PartRequest& part : job.parts) key.read(arguments.text(key.flag), part);
  }
  if (Status status = check_together(choice, arguments, job); !status) return status.error();
  if (arguments.has("--job")) {
    if (Status status = check_parts_of_file(arguments.text("--job"), job); !status) return status.error();
  }
  if (Status status = check_outputs(arguments, job); !status) return status.error();
  return job;
}

Status check_needs(Product product, const Arguments& arguments, const Job& job, bool study) {
  // A job that selects the pattern "none" has no lines by intention.
  const bool intended =
      (arguments.has("--pattern") || arguments.has("--fill")) && job.fill.all.pattern == infill::Pattern::kNone;
  for (const Need& need : kNeeds) {
    const bool beads = need.met == deposits_lines || need.met == deposits_beads || need.met == turns_lines;
    const auto met = study ? need.in_study : need.met;
    if (!arguments.has(need.flag) || met == nullptr || met(product, job) || (beads && intended)) continue;
    return at_option(need.flag, std::string(need.unmet));
  }
  if (arguments.has("--no-repair") && arguments.has("--repair") && arguments.text("--repair") != "off")
    return usage("--no-repair and --repair exclude each other; give one of them");
  return {};
}

Status check_machine_needs(const Machine& machine, const Arguments& arguments) {
  constexpr std::string_view kDosed[] = {"--saturation", "--core-saturation", "--core", "--levels", "--job", "--set"};
  const auto given = [&](std::string_view flag) { return arguments.has(flag); };
  if (!given("--allow-unbound") || machine.powder.min_saturation_percent > 0 || std::ranges::any_of(kDosed, given)) return {};
  return at_option("--allow-unbound", fmt::format("applies to a saturation or to powder.min_saturation_percent, which {} does "
                                                  "not state; add --saturation",
                                                  machine.name));
}

Status check_machine_needs(const Extruder& machine, const Arguments& arguments) {
  if (machine.format != "sml") return {};
  for (const std::string_view flag : kOfGcode) {
    if (arguments.has(flag))
      return at_option(flag, fmt::format("is not in SML, which {} reads; set it at the printer", machine.name));
  }
  return {};
}

namespace {

/// Keys of files and --set that do nothing in this job, but for defaults.
void add_notes_on_keys(Product product, const Arguments& arguments, const Job& job, std::vector<std::string>& notes) {
  const Job plain;
  for (const Need& need : kNeeds) {
    if (arguments.has(need.flag) || need.met(product, job)) continue;
    for (const JobKey& key : job_keys()) {
      const std::string name = fmt::format("{}.{}", key.section, key.name);
      if (key.flag == need.flag && is_named(job, name) && decides_in(product, key, job) && key.write(job) != key.write(plain))
        notes.push_back(fmt::format("{}: {}", name, need.unmet));
    }
  }
}

}  // namespace

std::vector<std::string> notes_on_needs(Product product, const Arguments& arguments, const Job& job) {
  std::vector<std::string> notes;
  if (arguments.has("--layer") && !job.heights.thickness_mm.empty()) {
    notes.emplace_back("--layer does nothing here, layers are as thick as --thickness says; leave it out");
  }
  const bool hollow = product == Product::kImages && fills(job) && !deposits_lines(product, job);
  if (hollow && !is_named(job, "fill.pattern") && !is_named(job, "segment.fill")) {
    notes.emplace_back(
        "nothing is filled inside the walls, and powder stays loose there; add --fill raster, or --fill none if it is meant");
  }
  for (const JobKey& key : job_keys()) {
    // What may be meant as one number is two.
    if (key.value.find("|XxY") == std::string_view::npos && key.value.find("MM[,") == std::string_view::npos) continue;
    const std::string text = key.flag.empty() ? std::string() : arguments.text(key.flag), hint = comma_hint(text);
    if (!hint.empty() && text.find_first_not_of("0123456789,") == std::string::npos)
      notes.push_back(fmt::format("{} {}: is two numbers{}", key.flag, text, hint));
  }
  if (product == Product::kMoves && !job.output.empty() && !std::filesystem::path(job.output).has_extension())
    notes.push_back(fmt::format("-o {}: is written as one file; end its name with .gcode or .sml", job.output));
  add_notes_on_keys(product, arguments, job, notes);
  for (const std::string& assignment : arguments.all("--set")) {
    const auto key = std::ranges::find_if(job_keys(), [&](const JobKey& k) {
      return assignment.starts_with(fmt::format("{}.{}=", k.section, k.name)) && !decides_in(product, k, job);
    });
    if (key != job_keys().end()) {
      notes.push_back(fmt::format("--set {}: {}.{} decides nothing here; leave it out", assignment, key->section, key->name));
    }
  }
  return notes;
}

}  // namespace lamina::pipeline
