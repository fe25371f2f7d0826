// Sections [load] and [run].
#include "pipeline/job/keys.h"
#include "stages/geometry/isa.h"

namespace lamina::pipeline {
namespace {

constexpr Word<Engine> kEngines[] = {{"rays", Engine::kRays}, {"contours", Engine::kContours}, {"both", Engine::kBoth}};

constexpr Word<Sync> kSyncs[] = {{"layer", Sync::kLayer}, {"job", Sync::kJob}, {"off", Sync::kOff}};

using Pair = std::optional<std::array<std::uint32_t, 2>>;

std::string write_bytes(const std::uint64_t& bytes) {
  for (const auto& [letter, shift] : {std::pair{"G", 30}, {"M", 20}, {"K", 10}}) {
    if (bytes % (1ull << shift) == 0) return fmt::format("{}{}", bytes >> shift, letter);
  }
  return fmt::format("{}", bytes);
}

constexpr Isa kIsas[] = {Isa::kAuto, Isa::kPlain, Isa::kAvx2, Isa::kAvx512};

std::string read_isa(std::string_view text, Isa& isa) {
  for (Isa one : kIsas) {
    if (isa_name(one) == text) return isa = one, std::string();
  }
  return "has to be auto, plain, avx2 or avx512";
}
/// Jobs are saved for any processor unless one was meant.
std::string write_isa(const Isa& isa) { return std::string(isa == Isa::kAuto ? std::string_view() : isa_name(isa)); }
std::vector<std::string_view> isa_words() {
  std::vector<std::string_view> words;
  for (Isa isa : kIsas) words.push_back(isa_name(isa));
  return words;
}

template <std::string (*Read)(std::string_view, std::array<std::uint32_t, 2>&)>
std::string read_pair(std::string_view text, Pair& pair) {
  std::array<std::uint32_t, 2> read{};
  auto wrong = Read(text, read);
  if (wrong.empty()) pair = read;
  return wrong;
}
std::string write_layers(const Pair& layers) {
  if (!layers) return {};
  const auto [first, last] = *layers;
  return last == UINT32_MAX ? fmt::format("{}:", first) : fmt::format("{}:{}", first, last);
}

std::string write_share(const Pair& share) {
  return share ? fmt::format("{}/{}", (*share)[0] + 1, (*share)[1]) : std::string();
}

// true and false mean auto and off; they are what is written.
std::string read_repair(std::string_view text, Job& job) {
  const bool winding = text == "winding" || text == "\"winding\"", off = text == "off" || text == "false";
  if (!winding && !off && text != "auto" && text != "true") return "has to be auto, winding or off";
  job.repair = !off;
  job.winding = winding;
  return {};
}
std::string write_repair(const Job& job) { return !job.repair ? "false" : job.winding ? "\"winding\"" : "true"; }

JobKey repair_key(const KeyName& name) {
  JobKey key = custom<Job, read_repair, write_repair>(name, Form::kBare);
  key.copy_value = [](const JobKey&, const Job& from, Job& to) { to.repair = from.repair, to.winding = from.winding; };
  return key;
}

const JobKey kLoadKeys[] = {
    repair_key({"load", "repair", "--repair", "MODE",
                "how open meshes are closed: auto, winding (by winding number, approximate) or off", decides::all})
        .with_words([] {
          return std::vector<std::string_view>{"auto", "winding", "off"};
        }),
    // The row above decides; this one is an option only.
    repair_key({"load", "repair", "--no-repair", "", "plan open meshes as they are instead of closing them", 0, "false"})
        .shown_if([](const Job&) { return false; }),
    field<&Job::drop_bad>({"load", "drop_bad", "--drop-bad", "",
                           "drop facets with coordinates that are no numbers instead of refusing the file", decides::all,
                           "true"}),
    field<&Job::weld_um>({"load", "weld_um", "--weld", "UM",
                          "repair joins open edges this far apart, in micrometres; 5 grows by itself", decides::all},
                         {0, 1e6, " um"}),
};

const JobKey kRunKeys[] = {
    text<check_path, &Job::output>({"run", "output", "-o,--output", "DIR", "directory for the layers and the manifest"}),
    word<kEngines, &Job::engine>(
        {"run", "engine", "--engine", "ENGINE", "rays, contours, or both to compare them; all give the same bytes"}),
    custom<Job, read_isa, write_isa, &Job::isa>(
        {"run", "isa", "--isa", "SET",
         "instructions of the inner loops: auto for the processor's widest, plain, avx2 or avx512; all give the same bytes"},
        Form::kString)
        .with_words(isa_words),
    field<&Job::threads>({"run", "threads", "--threads", "N", "0 for all that the machine has"}, {0, 4096}),
    custom<Job, read_bytes, write_bytes, &Job::memory_bytes>(
        {"run", "memory", "--memory", "SIZE", "what the layers in flight may hold beside the mesh: 256M, 1G"}, Form::kString),
    word<kSyncs, &Job::sync>({"run", "sync", "--sync", "WHEN",
                              "what survives a power cut: job, all of it once it has ended, for some 0.1 s; layer, all but the "
                              "layers in flight while it runs too, for some ms a layer; off, nothing for certain"}),
    custom<Job, read_pair<read_layer_range>, write_layers, &Job::layers>(
        {"run", "layers", "--layers", "A:B", "only layers A to B - 1, counted from 0 at the bottom; A: and :B are open"},
        Form::kString),
    field<&Job::strict>({"run", "strict", "--strict", "", "warnings are errors: exit 5, and nothing is written", 0, "true"}),
    field<&Job::allow_empty>({"run", "allow_empty", "--allow-empty", "",
                              "finish a whole job without a single pixel, contour or bead instead of refusing it", 0, "true"}),
    field<&Job::inspect>({"run", "inspect", "--inspect", "",
                          "look through the layers for what hangs on nothing, closed hollows, thin places and parts that touch",
                          0, "true"}),
    field<&Job::least_wall_mm>(
        {"run", "least_wall_mm", "--least-wall", "MM", "what --inspect tells as thin; two pixels, or a drop, if absent"},
        {0, 1000, " mm"}),
    field<&Job::allow_unbound>({"run", "allow_unbound", "--allow-unbound", "",
                                "plan a job although layers get less binder than the machine's powder needs to hold", 0,
                                "true"})
        .shown_if([](const Job& job) { return job.allow_unbound; }),
    custom<Job, read_pair<read_shard>, write_share, &Job::shard>(
        {"run", "shard", "--shard", "I/N", "only the I-th of N equal shares of the layers, I from 1; see lamina merge"},
        Form::kString),
};

}  // namespace

std::span<const JobKey> load_keys() { return kLoadKeys; }
std::span<const JobKey> run_keys() { return kRunKeys; }

}  // namespace lamina::pipeline
