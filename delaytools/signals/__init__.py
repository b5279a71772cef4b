"""What flows: records, responses, parameters, units, formulas, and the words of trouble."""
