# Doxygen's input filter: our plain comments as documentation. Lines that are
# indented stay as they are: formulas, tables, code. In others nothing is a
# command of Doxygen.
s|^( *)//(   +[^ ])|\1///    \2|
\|^ *///|!{
  \|^ *//|s|[\\@<>#*&%]|\\&|g
  s|^( *)//( .*)?$|\1///\2|
  s|([;,])  // (.*)|\1  ///< \2|
}
1s|^///|/// @file\n///|
