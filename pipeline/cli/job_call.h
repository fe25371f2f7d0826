// pipeline/cli/job_call.h: runs a command line of this program as a job, in this process.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "pipeline/batch/job.h"
#include "pipeline/cli/terminal/arguments.h"
#include "stages/data/status.h"

namespace lamina::load {
class PartStore;
}

namespace lamina::pipeline {

class Context;   // pipeline/cli/command.h
class JobCache;  // pipeline/cache/store.h

/// The cache of --cache and --cache-link; none without them, or, with a note, where it cannot be written.
/// errors  kUsage: the folder is no cache, or in the output; --cache-link alone
Result<std::shared_ptr<JobCache>> open_cache(const Arguments& arguments, Context& context);

/// Adds --container to the words of jobs that accept it and do not name one. kind  "": none is added
void add_container(std::vector<BatchEntry>& entries, const std::string& kind);

/// Reads a command line of at least one word: any command but batch, watch and preview.
/// errors  kUsage: no such command, wrong arguments, a job file that cannot be read
Result<Call> read_call(const std::vector<std::string>& words);

/// A command line that read_call() has read, without the options that name files to be written.
PackedWords without_outputs(const BatchJob& job);

/// Runs jobs whose command lines read_call() has read. The command's results and its first error are in the result; its
/// messages are discarded.
/// sync   when files are flushed to disk, for jobs without a setting of their own; "" for none
/// cache  for jobs without --cache; none: no cache
/// loaded  parts that jobs share; none: each job reads its files
RunJob job_runner(const std::string& sync, std::shared_ptr<load::PartStore> loaded, std::shared_ptr<JobCache> cache = {});

}  // namespace lamina::pipeline
