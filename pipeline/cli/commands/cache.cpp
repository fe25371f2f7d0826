#include <fmt/format.h>

#include <chrono>

#include "pipeline/cache/upkeep.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/job/errors.h"
#include "stages/support/io/file.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

CommandSpec cache_spec() {
  CommandSpec spec;
  spec.summary =
      "Prints the size of a cache of finished jobs (--cache of jet, extrude and batch), how often it was used, and the age of\n"
      "its entries. Trims it, or finds damaged files. Processes that use the cache at the same time are not disturbed.";
  spec.operand = "FOLDER";
  spec.operand_meaning = "the folder of the cache";
  spec.options = {{"--max-size", "SIZE", "remove the entries used longest ago beyond it: 500M, 50G", "", ""},
                  {"--verify", "", "read all files; remove damaged ones (exit code 5)", "", ""},
                  {"--json", "", "print the result as one JSON object on stdout", "", ""},
                  {"--quiet", "", "print errors and damaged files only", "", ""}};
  spec.closing =
      "Everything in the folder can be removed at any time; what is missing is planned again.\n\n"
      "Examples:\n"
      "  lamina batch jobs.txt -o out --cache ~/.cache/lamina\n"
      "  lamina cache ~/.cache/lamina\n"
      "  lamina cache ~/.cache/lamina --max-size 50G\n"
      "  lamina cache ~/.cache/lamina --verify";
  return spec;
}

std::int64_t now_in_seconds() {
  return std::chrono::duration_cast<std::chrono::seconds>(std::chrono::system_clock::now().time_since_epoch()).count();
}

std::string age_text(std::int64_t seconds) {
  if (seconds < 2 * 60) return fmt::format("{} s", std::max<std::int64_t>(seconds, 0));
  if (seconds < 2 * 3600) return fmt::format("{} min", seconds / 60);
  return seconds < 2 * 86400 ? fmt::format("{} h", seconds / 3600) : fmt::format("{} d", seconds / 86400);
}

void say_size(const CacheSize& size, std::int64_t now_s, Answer& answer) {
  answer.say(fmt::format("entries   {} of {} files, {}", readable_count(size.entries), readable_count(size.objects),
                         readable_bytes(size.bytes)));
  const std::uint64_t jobs = size.hits + size.misses;
  const double percent = jobs > 0 ? 100.0 * static_cast<double>(size.hits) / static_cast<double>(jobs) : 0;
  answer.say(fmt::format("used      {} of {} jobs taken from it ({:.0f} %)", readable_count(size.hits), readable_count(jobs),
                         percent));
  if (size.entries == 0) return;
  answer.say(fmt::format("age       last used {} to {} ago", age_text(now_s - size.newest_use_s),
                         age_text(now_s - size.oldest_use_s)));
}

Outcome run_cache(const Arguments& arguments, Context& context) {
  if (arguments.operands.size() != 1) return usage("name one folder of a cache");
  const std::string& folder = arguments.operands.front();
  std::uint64_t max_bytes = 0;
  if (Status status = arguments.read("--max-size", read_bytes, max_bytes); !status) return status;
  if (!is_file(folder + "/CACHEDIR.TAG")) return usage("{}: is no cache of lamina; name a folder given to --cache", folder);
  const auto cache = JobCache::open(folder, false);
  if (!cache) return cache.error();
  keep_on_signals();
  const std::int64_t now_s = now_in_seconds();
  Answer answer(arguments, context);
  Json json{{"command", "cache"}, {"directory", folder}};
  int code = 0;
  if (arguments.has("--verify")) {
    const auto checked = check_cache(**cache, context.cancel());
    if (!checked) return checked.error();
    for (const std::string& line : checked->damaged)
      code = context.complain({Fault::kVerification, fmt::format("{}: {}; removed", folder, line)});
    answer.say(fmt::format("verified  {} entries, {} files, {}: {} damaged", readable_count(checked->entries),
                           readable_count(checked->objects), readable_bytes(checked->bytes), checked->damaged.size()));
    json["damaged"] = checked->damaged;
  }
  if (arguments.has("--max-size")) {
    const auto trimmed = trim_cache(**cache, max_bytes, now_s, context.cancel());
    if (!trimmed) return trimmed.error();
    answer.say(fmt::format("removed   {} entries, {} files, {}", readable_count(trimmed->entries),
                           readable_count(trimmed->objects), readable_bytes(trimmed->bytes)));
    json["removed_entries"] = trimmed->entries;
    json["removed_bytes"] = trimmed->bytes;
  }
  const auto size = measure_cache(**cache);
  if (!size) return size.error();
  say_size(*size, now_s, answer);
  if (Status status = answer.status(); !status) return status;
  if (!arguments.has("--json")) return code;
  json.update(Json{{"entries", size->entries},
                   {"files", size->objects},
                   {"bytes", size->bytes},
                   {"hits", size->hits},
                   {"misses", size->misses}});
  if (size->entries > 0) {
    json["newest_use_seconds"] = now_s - size->newest_use_s;
    json["oldest_use_seconds"] = now_s - size->oldest_use_s;
  }
  const Status given = context.give(json);
  return given ? Outcome(code) : Outcome(given);
}

}  // namespace

const Command cache_command = {"cache", "size, use and damage of a cache of finished jobs", cache_spec, run_cache};

}  // namespace lamina::pipeline
