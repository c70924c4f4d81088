# Doxygen's input filter: gives it our plain comments as documentation.
#
#   awk -f docs/reference/comments.awk lib/invgrad/minimize/minimizer.h
#
# The comment that opens a header documents the file, and the class of the same
# name if that has no comment of its own. A comment in front of a declaration
# documents it, one behind a member the member. In comments,
#
#   - paragraphs that are indented are formulas, tables or code, and stay so;
#   - "Cost:    text" is a section;
#   - everything else is text, whatever it means to Doxygen or to Markdown.
#
# Comments in function bodies, between parameters and in front of nothing are
# comments.

{ line[NR] = $0 }

END {
  n = split(FILENAME, parts, "/")
  stem = parts[n]
  sub(/[.].*/, "", stem)
  i = 1
  if (is_comment(line[1])) i = file_comment()
  while (i <= NR) i = one_line(i)
}

function is_comment(text) { return text ~ /^ *\/\// }

# The text behind "//" and one space.
function comment_text(text) {
  sub(/^ *\/\/ ?/, "", text)
  return text
}

function file_comment(   i) {
  for (i = 1; is_comment(line[i]); ++i) block[i] = comment_text(line[i])
  print "/// @file"
  file_text = documentation(i - 1)
  printf "%s", file_text
  return i
}

# Prints what begins in line i, and returns where the next begins.
function one_line(i,   j, size, code, at, text, column) {
  if (is_comment(line[i])) {
    for (j = i; is_comment(line[j]); ++j) {
      block[++size] = comment_text(line[j])
    }
    if (in_scope() && line[j] ~ /[^ ]/ && line[j] !~ /^ *}/ &&
        line[j] !~ /^ *(public|private|protected):/) {
      printf "%s", documentation(size)
      follow_up = j
    } else {
      for (; i < j; ++i) print line[i]
    }
    return j
  }
  if (in_scope() && follow_up != i && is_own_class(i)) {
    printf "%s", file_text
    is_class_documented = 1
    if (line[i] ~ /^template/) follow_up = i + 1
  }
  code = line[i]
  at = match(code, /  \/\/ /)
  text = at ? comment_text(substr(code, at)) : ""
  if (at) code = substr(code, 1, at - 1)
  follow(code)
  if (!at || !in_scope() || code ~ /^ *[}#]/ || code ~ /[{:(]$/) {
    print line[i]
    return i + 1
  }
  print code "  ///< " escaped(text)
  # It goes on below, in the same column.
  column = at + 2
  for (++i; is_comment(line[i]) && match(line[i], /[^ ]/) == column; ++i) {
    print "  ///< " escaped(comment_text(line[i]))
  }
  return i
}

function is_own_class(i,   text, name) {
  if (is_class_documented) return 0
  text = line[i] ~ /^template/ ? line[i + 1] : line[i]
  if (text !~ /^(class|struct) [A-Za-z]+/ || text ~ /;$/) return 0
  split(text, name, / /)
  return snake_case(name[2]) == stem
}

# "UpdateCallback" -> "update_callback"
function snake_case(name,   result, k, c) {
  for (k = 1; k <= length(name); ++k) {
    c = substr(name, k, 1)
    result = result (c ~ /[A-Z]/ && k > 1 ? "_" : "") tolower(c)
  }
  return result
}

# --- Where we are in the code ---

# Whether declarations are documented here: not in a body or in parentheses.
function in_scope() { return num_bodies == 0 && num_parentheses == 0 }

function follow(code,   k, c) {
  if (is_macro || code ~ /^ *#/) {
    is_macro = code ~ /\\$/
    return
  }
  gsub(/\\./, "", code)
  gsub(/"[^"]*"/, "", code)
  gsub(/'[^']*'/, "", code)
  for (k = 1; k <= length(code); ++k) {
    c = substr(code, k, 1)
    if (c == "(") ++num_parentheses
    if (c == ")") --num_parentheses
    if (c == "{") {
      is_body[++depth] = !opens_scope()
      num_bodies += is_body[depth]
    } else if (c == "}") {
      num_bodies -= is_body[depth--]
    }
    statement = c ~ /[{};]/ ? "" : statement c
  }
  statement = statement " "
}

# Whether the brace that follows `statement` holds declarations.
function opens_scope() {
  gsub(/__attribute__\(\(.*\)\)/, "", statement)
  return statement ~ /(^| )(namespace|class|struct|union|enum)( |$)/ &&
         statement !~ /[()=]/
}

# --- From a comment to Doxygen's ---

# block[1 .. size] as lines of "///".
function documentation(size,   i, text, result, indent, label, verbatim) {
  in_code = 0
  for (i = 1; i <= size; ++i) {
    text = block[i]
    if (text == "") {
      # A blank line within a formula, if the next line is one too.
      if (verbatim && i < size && block[i + 1] ~ /^  /) {
        result = result "///\n"
        continue
      }
      if (verbatim) result = result "/// ~~~\n"
      verbatim = 0
      indent = 0
      result = result "///\n"
      continue
    }
    match(text, /[^ ]/)
    if (!verbatim && indent > 0 && RSTART == indent) {
      result = result "/// " escaped(substr(text, indent)) "\n"
      continue
    }
    if (text ~ /^  /) {
      if (!verbatim) result = result "/// ~~~{.unparsed}\n"
      verbatim = 1
      result = result "/// " text "\n"
      continue
    }
    if (verbatim) result = result "/// ~~~\n"
    verbatim = 0
    indent = 0
    if (is_section(text, i < size ? block[i + 1] : "")) {
      match(text, /: +/)
      RLENGTH += RSTART - 1
      label = text
      sub(/:.*/, "", label)
      indent = RLENGTH + 1
      # What follows without a blank line would be the section's.
      result = result "///\n/// @par " label "\n"
      text = substr(text, indent)
    } else if (match(text, /^\[[0-9]+\] +/)) {
      indent = RLENGTH + 1
      result = result "///\n"
    } else if (result ~ /@par [^\n]*\n(\/\/\/ [^\n]*\n)+$/) {
      result = result "///\n"
    }
    result = result "/// " escaped(text) "\n"
  }
  if (verbatim) result = result "/// ~~~\n"
  return result
}

# "Cost:    text", alone or with `next_line` in the column of its text.
function is_section(text, next_line,   column) {
  if (text !~ /^[A-Z][a-z]+: +[^ ]/) return 0
  match(text, /: +/)
  column = RSTART + RLENGTH
  match(next_line, /[^ ]/)
  return RSTART == column ||
         text ~ /^(Shapes|Units|Cost|Memory|Needs|Fails|Source|Threads):/
}

# Text that means nothing but itself, outside of `code`.
function escaped(text,   pieces, n, k, result) {
  n = split(text, pieces, "`")
  for (k = 1; k <= n; ++k) {
    if (k > 1) {
      result = result "`"
      in_code = !in_code
    }
    if (!in_code) {
      gsub(/[\\@<>#*&%]/, "\\\\&", pieces[k])
      gsub(/--/, "\\--", pieces[k])
      if (k == 1) {
        if (pieces[k] ~ /^[-+=] /) pieces[k] = "\\" pieces[k]
        if (match(pieces[k], /^[0-9]+[.] /)) sub(/[.]/, "\\.", pieces[k])
      }
    }
    result = result pieces[k]
  }
  return result
}
