#pragma once

#include <CLI/CLI.hpp>

#include <string>

/// One function per verb: it adds its subcommand with options and a callback that does the work.
/// A callback throws InputError (exit 2) or RunError (exit 1); main() prints the message as one line.
namespace scatter::app {

/// What all verbs share.
struct Context {
  std::string command_line; ///< as typed, for provenance
  bool verbose = false;
};

void add_mie(CLI::App& app, Context& context);
void add_cylinder(CLI::App& app, Context& context);
void add_phase(CLI::App& app, Context& context);
void add_validate(CLI::App& app, Context& context);
void add_info(CLI::App& app, Context& context);
void add_plot(CLI::App& app, Context& context);
void add_fiber(CLI::App& app, Context& context);

} // namespace scatter::app
