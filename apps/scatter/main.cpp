// The program `scatter`: one verb per job. Exit 0: done; 1: failed while running; 2: wrong input. Every
// failure is one line on standard error, `scatter VERB: what is wrong, where, and what would be right`.
#include "verbs.hpp"
#include <scatter/optics/errors.hpp>
#include <scatter/optics/spelling.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/optics/version.hpp>
#include <scatter/table/files.hpp>

#include <CLI/CLI.hpp>
#include <pthread.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <iostream>
#include <new>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

namespace {

constexpr int failed = 1;
constexpr int wrong_input = 2;

using AddVerb = void (*)(CLI::App&, scatter::app::Context&);
constexpr AddVerb verbs[] = {scatter::app::add_mie,      scatter::app::add_cylinder, scatter::app::add_phase,
                             scatter::app::add_validate, scatter::app::add_info,     scatter::app::add_plot,
                             scatter::app::add_fiber};

/// Killed or stopped: no half file stays behind, and whoever waits for us sees the signal, as the convention
/// wants.
[[noreturn]] void clean_up_and_die(int signal_number) {
  scatter::table::remove_unfinished_files();
  (void)std::signal(signal_number, SIG_DFL);
  sigset_t only_this;
  ::sigemptyset(&only_this);
  ::sigaddset(&only_this, signal_number);
  (void)::pthread_sigmask(SIG_UNBLOCK, &only_this, nullptr);
  (void)::raise(signal_number);
  std::_Exit(128 + signal_number); // not reached: none of these signals is survived by default
}

/// A thread waits for the signals that end us. A handler would not do: the compiler inside OpenCL installs
/// handlers of its own over ours, and its one for SIGXCPU and SIGQUIT returns as if nothing had been.
void watch_signals() {
  // A reader that goes away and a file that grows past its limit become errors of the write: one line,
  // exit 1.
  (void)std::signal(SIGPIPE, SIG_IGN);
  (void)std::signal(SIGXFSZ, SIG_IGN);
  sigset_t endings;
  ::sigemptyset(&endings);
  for (const int signal_number : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGXCPU}) {
    struct sigaction now {};
    // What the caller ignores stays ignored: that is how nohup works.
    if (::sigaction(signal_number, nullptr, &now) == 0 && now.sa_handler == SIG_IGN) continue;
    ::sigaddset(&endings, signal_number);
  }
  // Threads inherit the mask, so this comes before any other thread.
  if (::pthread_sigmask(SIG_BLOCK, &endings, nullptr) != 0) return;
  try {
    std::thread([endings] {
      int signal_number = 0;
      if (::sigwait(&endings, &signal_number) == 0) clean_up_and_die(signal_number);
    }).detach();
  } catch (const std::system_error&) { // no thread to be had: die of signals without cleaning up
    (void)::pthread_sigmask(SIG_UNBLOCK, &endings, nullptr);
  }
}

/// The command as one would type it again, for the provenance of files.
std::string command_line(int argc, char** argv) {
  constexpr std::string_view harmless = "+,-./:=@_%";
  std::string line = "scatter";
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    const bool plain = !argument.empty() && std::ranges::all_of(argument, [&](unsigned char c) {
      return c >= 0x80 || std::isalnum(c) != 0 || harmless.find(static_cast<char>(c)) != harmless.npos;
    });
    line += ' ';
    if (plain) {
      line += argument;
      continue;
    }
    line += '\'';
    for (const char c : argument) line += c == '\'' ? std::string("'\\''") : std::string(1, c);
    line += '\'';
  }
  return line;
}

/// "did you mean X?" when something known is near enough to be meant, and where to look otherwise.
std::string advice(std::string_view word, const std::vector<std::string>& known, const std::string& help) {
  const auto name = scatter::nearest_name(word, known);
  return name ? "did you mean " + *name + "?" : "see " + help;
}

/// The verb that was asked for, and its name as typed: "scatter", "scatter phase", "scatter fiber azimuth".
struct Verb {
  const CLI::App* app;
  std::string name = "scatter";
};

Verb verb_of(const CLI::App& program) {
  Verb verb{&program};
  for (auto used = program.get_subcommands(); !used.empty(); used = verb.app->get_subcommands()) {
    verb.app = used.front();
    verb.name += " " + verb.app->get_name();
  }
  return verb;
}

/// What the command line's parser found wrong, in one line.
std::string describe(const CLI::ParseError& error, const CLI::App& program) {
  const auto [app, name_of_verb] = verb_of(program);
  const CLI::App& verb = *app;
  const std::string help = name_of_verb + " --help";
  const bool has_verbs = !verb.get_subcommands({}).empty();

  // A misspelt option often shows as a required one that is missing: the spelling is what to tell.
  const std::vector<std::string> extras = program.remaining(true);
  if (!extras.empty()) {
    const auto dashed =
        std::ranges::find_if(extras, [](const std::string& s) { return s.size() > 1 && s[0] == '-'; });
    if (dashed != extras.end()) {
      const std::string name = dashed->substr(0, dashed->find('='));
      std::vector<std::string> known;
      for (const CLI::Option* const option : verb.get_options())
        for (const std::string& long_name : option->get_lnames()) known.push_back("--" + long_name);
      return "unknown option " + scatter::quote(name) + "; " + advice(name, known, help);
    }
    if (has_verbs) {
      std::vector<std::string> known;
      for (const CLI::App* const subcommand : verb.get_subcommands({}))
        known.push_back(subcommand->get_name());
      return "unknown verb " + scatter::quote(extras.front()) + "; " + advice(extras.front(), known, help);
    }
    return "unexpected argument " + scatter::quote(extras.front()) + "; see " + help;
  }
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr && has_verbs)
    return "a verb is missing after " + verb.get_name() + "; see " + help;
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) {
    const std::string_view message = error.what();
    const std::string name(message.substr(0, message.find(':')));
    if (const CLI::Option* const option = verb.get_option_no_throw(name))
      return name + (option->count() > 1 ? " is given more than once" : " needs a value") + "; see " + help;
  }
  return std::string(error.what()) + "; see " + help;
}

int report(int code, const CLI::App& program, const std::string& message) {
  std::string line = verb_of(program).name + ": " + message;
  std::ranges::replace_if(
      line, [](unsigned char c) { return c < 0x20 || c == 0x7F; }, '?'); // one line, come what may
  (void)std::fprintf(stderr, "%s\n", line.c_str());
  return code;
}

int run(CLI::App& program, int argc, char** argv) {
  try {
    program.parse(argc, argv);
    if (program.get_subcommands().empty()) std::cout << program.help();
  } catch (const CLI::Success& success) { // --help, --version
    program.exit(success);
  } catch (const CLI::ParseError& error) {
    return report(wrong_input, program, describe(error, program));
  } catch (const scatter::InputError& error) {
    return report(wrong_input, program, error.what());
  } catch (const std::bad_alloc&) {
    return report(failed, program, "out of memory; ask for fewer angles, wavelengths or rays");
  } catch (const std::exception& error) {
    return report(failed, program, error.what());
  }
  // What was printed has arrived only now: a full disk or a reader gone shows here.
  errno = 0;
  std::cout.flush();
  if (!std::cout || std::fflush(stdout) != 0 || ::close(STDOUT_FILENO) != 0) {
    const std::string reason = errno != 0 ? std::string(": ") + std::strerror(errno) : std::string();
    return report(failed, program, "cannot write standard output" + reason);
  }
  return 0;
}

} // namespace

int main(int argc, char** argv) {
  watch_signals();
  scatter::app::Context context;
  context.command_line = command_line(argc, argv);

  CLI::App program("Computes how raindrops scatter light.", "scatter");
  program.set_version_flag("--version", std::string("scatter ") + scatter::version());
  program.require_subcommand(0, 1);
  program.footer(
      "Quantities carry units (0.4mm, 650nm, 20deg); ranges are first:last:step, lists have commas.\n"
      "Exit status: 0 done, 1 failed while running, 2 wrong input.");
  for (const AddVerb add : verbs) add(program, context);

  const auto logger = spdlog::stderr_color_mt("scatter");
  logger->set_pattern("%H:%M:%S.%e %v");
  logger->set_level(spdlog::level::off);
  spdlog::set_default_logger(logger);
  const auto be_verbose = [&](std::int64_t) {
    context.verbose = true;
    logger->set_level(spdlog::level::info);
  };
  program.add_flag_function("--verbose", be_verbose, "Log what is done to standard error");
  for (CLI::App* const verb : program.get_subcommands({})) {
    verb->add_flag_function("--verbose", be_verbose, "Log what is done to standard error");
    for (CLI::App* const below : verb->get_subcommands({}))
      below->add_flag_function("--verbose", be_verbose, "Log what is done to standard error");
  }

  return run(program, argc, argv);
}
