// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <vector>

#include "commands.h"
#include "evpose/core/version.h"
#include "evpose/io/files/atomic_file.h"

namespace evpose {
namespace {

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* command) { return !command->get_group().empty(); });
}

/// A command with all that are below it, each with the words that lead to it: "map build".
struct Command {
  std::string words;
  const CLI::App* app;
};
std::vector<Command> all_commands(const CLI::App& app, const std::string& words) {
  std::vector<Command> out{{words, &app}};
  for (const CLI::App* command : commands_of(app)) {
    const auto below =
        all_commands(*command, words.empty() ? command->get_name() : words + " " + command->get_name());
    out.insert(out.end(), below.begin(), below.end());
  }
  return out;
}

/// Text as roff takes it.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n')) out += "\\&";
    if (c == '-')
      out += "\\-";
    else if (c == '\\')
      out += "\\e";
    else
      out += c;
  }
  return out;
}

/// "-o, --output TEXT", or the name of a positional.
std::string heading_of(const CLI::Option& option) {
  std::string out;
  for (const std::string& name : option.get_snames())
    out += (out.empty() ? "\\fB\\-" : ", \\fB\\-") + roff(name) + "\\fR";
  for (const std::string& name : option.get_lnames())
    out += (out.empty() ? "\\fB\\-\\-" : ", \\fB\\-\\-") + roff(name) + "\\fR";
  if (out.empty()) return "\\fI" + roff(option.get_name(true)) + "\\fR";
  if (option.get_items_expected_max() > 0) out += " \\fI" + roff(option.get_type_name()) + "\\fR";
  return out;
}

std::string options_in_roff(const CLI::App& app) {
  std::string out;
  for (const CLI::Option* option : app.get_options()) {
    if (app.get_parent() != nullptr && option == app.get_help_ptr()) continue;  // every command has it
    out += ".TP\n" + heading_of(*option) + "\n" + roff(option->get_description());
    if (!option->get_default_str().empty()) out += " (default: " + roff(option->get_default_str()) + ")";
    out += "\n";
  }
  return out;
}

std::string man_page(const CLI::App& app) {
  std::string out = ".TH EVPOSE 1 \"\" \"evpose " + std::string(version()) + "\" \"User Commands\"\n";
  out += ".SH NAME\nevpose \\- " + roff(app.get_description().substr(app.get_description().find(": ") + 2)) +
         "\n";
  out += ".SH SYNOPSIS\n\\fBevpose\\fR [\\fIoptions\\fR] \\fIcommand\\fR [\\fIarguments\\fR]\n";
  out += ".SH OPTIONS\n" + options_in_roff(app) + ".SH COMMANDS\n";
  for (const Command& command : all_commands(app, "")) {
    if (command.words.empty()) continue;
    out += ".SS evpose " + roff(command.words) + "\n" + roff(command.app->get_description()) + "\n" +
           options_in_roff(*command.app);
    if (command.app->get_footer() != app.get_footer())
      out += ".PP\n" + roff(command.app->get_footer()) + "\n";
  }
  return out + ".SH EXIT STATUS\n" + roff(app.get_footer()) + "\n";
}

/// Names of commands and long options that may come next, separated by blanks.
std::string names_in(const CLI::App& app) {
  std::string out;
  for (const CLI::App* command : commands_of(app)) out += command->get_name() + " ";
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) out += "--" + name + " ";
  return out;
}

/// Options where a word begins with -, commands where one is due, else files.
std::string bash_completion(const CLI::App& app) {
  std::string descend, words;
  for (const Command& command : all_commands(app, "")) {
    const std::size_t last = command.words.rfind(' ');
    const std::string above = last == std::string::npos ? "" : command.words.substr(0, last);
    if (!command.words.empty())
      descend +=
          "      '" + above + ":" + command.app->get_name() + "') command='" + command.words + "' ;;\n";
    words += "    '" + command.words + "') names='" + names_in(*command.app) +
             "' due=" + (commands_of(*command.app).empty() ? "" : "yes") + " ;;\n";
  }
  return "# bash completion of evpose\n"
         "_evpose() {\n"
         "  local current=${COMP_WORDS[COMP_CWORD]} command= names= due= i\n"
         "  for ((i = 1; i < COMP_CWORD; ++i)); do\n"
         "    case \"$command:${COMP_WORDS[i]}\" in\n" +
         descend +
         "    esac\n"
         "  done\n"
         "  case \"$command\" in\n" +
         words +
         "  esac\n"
         "  COMPREPLY=()\n"
         "  if [[ $current == -* || $due ]]; then\n"
         "    COMPREPLY=($(compgen -W \"$names\" -- \"$current\"))\n"
         "  fi\n"
         "}\n"
         "complete -o default -F _evpose evpose\n";
}

}  // namespace

void add_manual(CLI::App& app, std::function<int()>& run) {
  auto* command = app.add_subcommand("manual", "Write a man page and a bash completion, made of the help");
  command->group("");  // for building and packaging: not among the commands of the help
  struct Files {
    std::string man, bash;
  };
  auto files = std::make_shared<Files>();
  command->add_option("--man", files->man, "man page to write");
  command->add_option("--bash", files->bash, "completion to write");
  command->callback([files, &app, &run] {
    run = [files, &app] {
      if (!files->man.empty())
        if (const auto ok = write_text_file(files->man, man_page(app)); !ok) return bad_input(ok.error());
      if (!files->bash.empty())
        if (const auto ok = write_text_file(files->bash, bash_completion(app)); !ok)
          return bad_input(ok.error());
      return 0;
    };
  });
}

}  // namespace evpose
